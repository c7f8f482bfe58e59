"""Runs with random faults at random times: no hang, no leak, every sample is recorded or counted as lost."""

from collections import Counter
from pathlib import Path

import pytest

from tests.daq.support.fault_campaign import run_of

RUNS = 240


@pytest.mark.parametrize("seed", range(15))
def test_run_with_random_faults_accounts_for_every_sample(seed: int, tmp_path: Path) -> None:
    run_of(seed, tmp_path)


@pytest.mark.campaign
def test_hundreds_of_runs_with_random_faults_account_for_every_sample(tmp_path: Path) -> None:
    troubles: Counter[str] = Counter()
    samples, longest, failed = 0, 0.0, {}
    for seed in range(1000, 1000 + RUNS):
        try:
            met, took, recorded = run_of(seed, tmp_path)
        except AssertionError as error:
            failed[seed] = str(error)
            continue
        troubles.update(met)
        samples, longest = samples + recorded, max(longest, took)
        (tmp_path / f"{seed}.mcap").unlink()
    print(f"\n{RUNS} runs, {samples:,} samples a channel in files, the longest run {longest:.1f} s")
    print("  " + ", ".join(f"{name.replace('_', ' ')} {count}" for name, count in troubles.most_common()))
    assert not failed
