"""What is typed wrong is one line: which command, which word, and what was meant."""

import pytest

from affinet.cli.commands import main

WRONG = {
    "run corridor --seeds 5-1": "affinet run: --seeds: '5-1': give the smaller seed first, and seeds below 2^64",
    "new estimtor x": "affinet new: KIND: 'estimtor': did you mean 'estimator'? there are scenario, estimator, law, ",
    "export RUN --to xlsx": "affinet export: --to: 'xlsx': there are parquet, netcdf, mcap, csv",
    "export RUN --to netcfd": "affinet export: --to: 'netcfd': did you mean 'netcdf'? there are parquet, ",
    "rnu corridor": "affinet: COMMAND: 'rnu': did you mean 'run'? there are run, check, ",
    "run": "affinet run: the following arguments are required: scenario; `affinet run --help` says what it takes",
    "run corridor --sede 3": "affinet run: --sede: not known here; did you mean '--seed'?",
    "run corridor --sede=3": "affinet run: --sede=3: not known here; did you mean '--seed'?",
    "run corridor once": "affinet run: once: not known here; `affinet run --help` says what is",
    "run corridor --view --serve": "affinet run: --serve: not allowed with argument --view",
    "run corridor --runtime inproc": "affinet run: --runtime: 'inproc': did you mean 'inprocess'? there are ",
    "run corridor --duration": "affinet run: --duration: expected one argument",
    "render RUN --out a.mp4 --fps 100": "affinet render: --fps: 100: give at most 60",
    "inject RUN ct 1-2": "affinet inject: VERB: 'ct': did you mean 'cut'? there are cut, partition, lose, heal, show",
    "inject RUN cut 1-2 --fro 2": "affinet inject RUN cut: --fro: not known here; did you mean '--for'?",
    "--versoin": "affinet: --versoin: not known here; did you mean '--version'?",
}


@pytest.mark.parametrize("line", WRONG)
def test_it_is_one_line(line, capsys):
    with pytest.raises(SystemExit) as ended:
        main(line.split())
    out, (said,) = (text.splitlines() for text in capsys.readouterr())
    assert (ended.value.code, out) == (2, [])
    assert said.startswith(WRONG[line])
