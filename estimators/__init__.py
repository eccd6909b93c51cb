"""Measurements in, state with covariance out."""
