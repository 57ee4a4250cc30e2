"""Uncertain numbers: distributions, designs of cases, polynomial chaos, what each input explains.

Knows nothing of limbs and studies: inputs have names, and outputs are arrays with a row a case.
"""
