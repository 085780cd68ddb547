"""Parameters from measurements, with their covariance and what makes it believed."""
