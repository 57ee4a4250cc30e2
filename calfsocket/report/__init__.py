"""The report of a study, made from its files alone: comparison, tables, scoreboard."""
