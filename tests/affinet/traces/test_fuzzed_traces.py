"""Files of link data that are damaged in whatever way: read, or refused in one line."""

from random import Random

import mutations
import pytest

from affinet.traces import formats, summary
from netem.impairments.measured import MeasuredError

HEADER = "PING b (10.0.0.2) 56(84) bytes of data.\n"
RIGHT = {
    "table": "time,src,dst,availability,delay\n0,1,2,.5,0.1\n0,2,1,50 %,\n",
    "ping": HEADER
    + "".join(f"[{n}.5] 64 bytes from b: icmp_seq={n} ttl=64 time=4.0 ms\n" for n in (1, 3, 2, 5))
    + "6 packets",
    "iperf3": '{"intervals": [\n{"sum": {"start": 0, "seconds": 1, "bits_per_second": 9, "packets": 9, "lost_packets": 1}}\n]}',
    "mahimahi": "1\n1\n3\n10\n",
    "one": "2.0\tCONN p1 p2 up\n3.0 C M1 1 2 500\n5 CONN 1 2 down\n",
    "contacts": "2.0 1 2 up\n5.0 1 2 down\n",
    "intervals": "1 2 2 4 1 0\n2 1 3 5 1 0\n",
    "emane": "-10 nem:1 pathloss nem:2,90.5 nem:3,110,112\n0 nem:1 location gps 1,2\n",
    "setdest": "$node_(1) set X_ 9\n$node_(1) set Y_ 9\n$node_(0) set X_ 0.0\n$node_(0) set Y_ 0\n"
    '$ns_ at 1.0 "$node_(0) setdest 30.0 40.0 10.0"\n',
    "bonnmotion": "0 0 0 10 100 0\n0 5 5\n",
}


def test_every_format_is_damaged():
    assert RIGHT.keys() == formats.FORMATS.keys()


@pytest.mark.parametrize("told", [True, False], ids=["told", "found"])
@pytest.mark.parametrize("name", RIGHT)
def test_a_damaged_file_is_read_or_refused_in_a_line(name, told, tmp_path):
    file, refused = tmp_path / "field.txt", []
    for number in range(150):
        file.write_bytes(mutations.of_bytes(Random(number), RIGHT[name].encode()))
        try:
            _, data = formats.read(file, name if told else None)
            summary.summaries(data)
        except MeasuredError as error:
            refused.append(str(error))
    assert 0 < len(refused) < 150
    assert [said for said in refused if "\n" in said or len(said) > 400] == []
