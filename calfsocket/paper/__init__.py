"""The paper that this program repeats: its numbers, tables, figures and claims, beside a study."""
