"""Verification and recovery of recordings."""
