"""The observation equations of a network: unknowns, residuals and derivatives."""
