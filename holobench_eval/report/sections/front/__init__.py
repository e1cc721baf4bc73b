"""The first page of a report: question, answer, limits, one table, one plot, one row of pictures."""
