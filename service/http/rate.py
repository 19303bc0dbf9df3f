"""Token buckets: how many requests a client may make."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Hashable
from dataclasses import dataclass

_MOST_CLIENTS = 1024


@dataclass
class _Bucket:
    tokens: float
    filled_at: float


class Buckets:
    """One bucket for each client and kind of request, for the clients heard last.

    A bucket holds what may come at once: `burst_s` seconds' worth, and never less than one request.
    """

    def __init__(self, *, burst_s: float = 2.0) -> None:
        self._burst_s = burst_s
        self._buckets: OrderedDict[Hashable, _Bucket] = OrderedDict()

    def take(self, who: Hashable, per_s: float, now: float, count: float = 1.0) -> float:
        """Take `count` requests from a bucket that fills at `per_s` a second.

        Returns 0.0 when they may pass, else how many seconds to wait; nothing is taken then. A count larger
        than the bucket passes when the bucket is full, and is paid back by the time that follows.
        """
        size = max(1.0, per_s * self._burst_s)
        bucket = self._buckets.get(who)
        if bucket is None:
            bucket = self._buckets[who] = _Bucket(size, now)
            if len(self._buckets) > _MOST_CLIENTS:
                self._buckets.popitem(last=False)
        self._buckets.move_to_end(who)
        bucket.tokens = min(size, bucket.tokens + max(0.0, now - bucket.filled_at) * per_s)
        bucket.filled_at = now
        wanted = min(count, size)
        if bucket.tokens < wanted:
            return (wanted - bucket.tokens) / per_s
        bucket.tokens -= count
        return 0.0
