"""The report's figures and the study of mismatched rates, run from a checkout."""
