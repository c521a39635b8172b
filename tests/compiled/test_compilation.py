"""Reports of compilations, from this process and from others."""

import logging

import pytest

from omnidrive.compiled import announce_compiling
from omnidrive.compiled.compilation import (
    Compilation,
    CompileRelay,
    compile_listeners,
    notify,
    reported,
)


def test_compiling_is_announced_once_and_only_if_it_happens(build, caplog):
    def announced():
        caplog.clear()
        module = build()
        with announce_compiling():
            module.caller(1.0)
            module.later(1.0)
        return [record.message.split(";")[0] for record in caplog.records]

    assert announced() == ["compiling kernels before their first use"]
    assert announced() == []
    assert compile_listeners == []


def test_each_kernel_is_reported_with_its_time(build, caplog):
    caplog.set_level(logging.INFO, logger="omnidrive.compiled")
    module = build()
    with announce_compiling(note=""):
        module.caller(1.0)
    start, end = (record.compilation for record in caplog.records)
    assert start == ("kernels_of_a_test.caller.caller", None)
    assert end.kernel == start.kernel
    assert 0.0 < end.seconds < 60.0


def test_failed_compilation_ends(monkeypatch):
    found = []
    monkeypatch.setattr("omnidrive.compiled.compilation.compile_listeners", [found.append])
    with pytest.raises(ZeroDivisionError), reported("kernel"):
        _ = 1 // 0
    assert [each.seconds is None for each in found] == [True, False]


def test_only_the_outer_context_announces(caplog):
    with announce_compiling("outer"):
        with announce_compiling("inner"):
            notify(Compilation("kernel"))
        notify(Compilation("kernel"))
    assert [record.message for record in caplog.records] == ["outer"]


def test_reports_of_other_processes_arrive_in_order(monkeypatch):
    found = []
    monkeypatch.setattr("omnidrive.compiled.compilation.compile_listeners", [found.append])
    relay = CompileRelay()
    sent = [Compilation("a.b"), Compilation("a.b", 1.5), Compilation("c")]
    for each in sent:
        relay.send(each)
    relay.forward()
    relay.forward()
    assert found == sent


def test_reports_that_nobody_collects_do_not_block(monkeypatch):
    found = []
    monkeypatch.setattr("omnidrive.compiled.compilation.compile_listeners", [found.append])
    relay, sent = CompileRelay(), Compilation("kernel" * 10, 1.0)
    for _ in range(3000):
        relay.send(sent)
    relay.forward()
    assert 0 < len(found) < 3000
    assert set(found) == {sent}
