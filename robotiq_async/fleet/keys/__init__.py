"""Certificates, roles, and what each of them may do."""
