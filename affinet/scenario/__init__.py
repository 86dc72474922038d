"""A TOML in, a typed scenario out; every error with its file, key and what would be right."""

from affinet.scenario.loading import extended as extended
from affinet.scenario.loading import load as load
from affinet.scenario.loading import shipped as shipped
