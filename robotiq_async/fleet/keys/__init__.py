"""Certificates, roles and their rights."""
