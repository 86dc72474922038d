"""The medium as it should be, but that it says of one message more than there was that it arrived late."""

from netem.medium.medium import Medium
from netem.process import main

TICK = 4


def deliver(medium, air, tick, verdicts, honest=Medium.deliver):
    air, delivery = honest(medium, air, tick, verdicts)
    return air, delivery._replace(late=delivery.late + (tick == TICK))


if __name__ == "__main__":
    Medium.deliver = deliver
    main()
