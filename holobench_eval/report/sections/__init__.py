"""The sections of report.md: tables and sentences."""
