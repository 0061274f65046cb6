"""The registered complex: a crowd's unlabeled scans and steps become a radio map.

scans and own motion -> crowd -> likeness -> layout -> registration -> complex -> place;
`homsense.smoothing` polishes it and lets it grow.
"""
