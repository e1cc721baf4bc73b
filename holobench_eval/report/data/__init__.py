"""The numbers of a report, computed from the records of a study."""
