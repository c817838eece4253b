"""Speed as ratios to peers, measured in one run; decides no test (`python -m tests.benchmarks`)."""
