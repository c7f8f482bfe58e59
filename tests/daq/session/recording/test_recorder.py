"""Messages between the processes of a recording."""

from multiprocessing import get_context

from daq.session.recording.recorder import MessageSender


def test_messages_do_not_block_the_sender_and_stay_in_order() -> None:
    here, there = get_context("spawn").Pipe()
    outbox = MessageSender(here)
    sent = [b"%d" % k + b" " * 10_000 for k in range(100)]  # more than a pipe holds
    for message in sent:
        outbox.send(message)
    assert not outbox.close(0.01)
    assert [there.recv() for _ in sent] == sent
    assert outbox.close(60)
    there.close()
    here.close()


def test_messages_to_an_ended_process_are_dropped() -> None:
    here, there = get_context("spawn").Pipe()
    there.close()
    outbox = MessageSender(here)
    outbox.send("lost")
    assert outbox.close(60)
    here.close()
