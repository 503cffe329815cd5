"""The statement of the equations: pure functions of arrays with any leading axes, such as variants."""
