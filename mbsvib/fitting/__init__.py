"""Models fitted to measurements: values of parameters with their confidence.

variables     the values that a fit may change: parameters, gains, delays and lags; their bounds and prior knowledge
responses     frequency responses of some matrices and their derivatives
channels      gains, delays and filters through which something was measured
response_data measured frequency responses: residuals and derivatives, channels among them
record_data   time records: residuals of their Fourier coefficients, with free states where they begin
mode_data     measured modes: residuals and derivatives
problem       all data together, and the search: logarithms of responses first, then weighted residuals
knowledge     covariance, what the data do not tell, whether the structure explains them
candidates    which further sensor or exciter tells most
result        what a fit returns
"""
