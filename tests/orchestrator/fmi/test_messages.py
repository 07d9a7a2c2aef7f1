"""Log messages of FMUs are kept up to their bounds."""

from hapticlink.orchestrator.fmi import messages


def test_the_newest_messages_are_kept_and_no_novel():
    key = messages.opened()
    for i in range(20_000):
        messages.keep(key, 2, b"%d " % i + b"x" * 10_000)
    messages.keep(key, 0, b"all is well")
    messages.keep(key, -1, b"20000 is no status that FMI defines")
    kept = messages.newest(key)
    messages.closed(key)
    assert [said.split()[0] for said in kept] == [str(i) for i in range(19_996, 20_001)]
    assert {len(said) for said in kept[:-1]} == {messages.MAX_LENGTH}
    messages.keep(key, 3, b"after the end")
    assert messages.newest(key) == []
