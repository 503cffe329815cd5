"""Models fitted to measurements: values of parameters with their confidence.

variables     the values that a fit may change: parameters, gains, delays and filters of channels; bounds and priors
data          measured objects as data of a fit: response_data, record_data, mode_data
problem       all data together, and the search: logarithms of responses first, then weighted residuals
knowledge     covariance, what the data do not tell, whether the structure explains them
result        what a fit returns, and which further sensor or exciter tells most
"""
