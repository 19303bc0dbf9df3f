"""The border between the flight and those who talk to it: two processes and one small channel.

Whatever strangers send and ask for, they must not be able to keep the aircraft waiting: its heartbeat once a second,
the pilot's mode change, the operator's Hold. So what they touch lives in a process of its own, the door process: HTTP,
WebSocket, page, MQTT, UDP and the Unix socket, with their parsing, checks, rate limits and JSON. The link,
the mission, the belief, the intake and the journal stay in the flying process.

Why a process and not a thread? A thread shares the interpreter's lock with the flight, and `json.loads`, a validation
by pydantic or a text of a map hold it from their first byte to their last. With all in one process, 54 MB of MQTT
made a gap of 8.4 s in the heartbeat, wishes on a WebSocket delayed a Hold by 9.3 s, costly reports the heartbeat by
3.9 s, the map of a large area by 4.7 s; and a thread would have changed none of them but the time to draw a picture.
Between processes the kernel shares the time out, and it does so on one core too.

What passes, over one socket, in frames of JSON whose size is bounded (`frames`):

    doors → flight   order      an operator's, checked; given as soon as it is read
                     reports    a few dozen at a time, checked, a few frames under way (`limits`); the receipt comes
                                when they are on disk, as ever
                     look       the state, the map, what is new of the tracks; at most a tenth of the flight's time
                     metrics    what Prometheus is told
    flight → doors   one answer for each

Nothing is sent without having been asked for, so nothing can pile up on either side. The map itself passes through
memory that both share (`memory`). Everything a door sends is checked again on the flight's side (`counter`), and only
JSON is ever read there: who takes the door process over can send reports and orders, which he could before, and no
more.

What takes long to draw, the texts and pictures of maps, a third process draws for the door process (`drawing`), so that
an order never waits for a map either. Whatever strangers send has few turns before an order has its next one:
newcomers, datagrams, lines, what watchers say, the reports of a batch.

The addresses are taken by the flying process before anything starts, and inherited (`hello`). A door process that ends,
or hangs, is said and started again, and the flight goes on meanwhile (`keeper`). One that has lost its flight ends.
"""
