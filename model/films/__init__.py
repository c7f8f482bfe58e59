"""Oil films of floating-ring bearings: force models, coefficients, equilibrium and lubrication."""
