#!/usr/bin/env python3
"""The lint of the coroutine law on itself: each documented bad form is caught, each safe form passes."""

import unittest

from coroutine import check
from cpp_structs import AggregateIndex
from cpp_tokens import tokenize

TYPES = """
struct Agg { std::string mode; int n; };
struct fix { double latitude_deg, longitude_deg; float speed_kn; };
struct track { fix first; fix last; };
struct made { explicit made(std::string s); std::string s; };
"""


def rules(body, types=TYPES):
    source = tokenize(types + "\nise::task<> run() {\n" + body + "\n}\n")
    return sorted({rule for rule, _, _ in check(source, AggregateIndex([source]))})


BAD = {
    1: [
        "if (co_await f()) g();",
        "if (!co_await f()) g();",
        "if constexpr (co_await f()) g();",
        "if (auto x = co_await f()) g();",
        "if (int n = 0; co_await f(n)) g();",
        "while (co_await f()) g();",
        "while (auto packet = co_await fixes.next()) use(*packet);",
        "do { g(); } while (co_await f());",
        "for (int i = 0; co_await f(i); ++i) g();",
        "switch (co_await f()) { default: break; }",
        "if (a && (b || co_await f())) g();",
        "auto l = [&]() -> ise::task<> { if (co_await f()) g(); };",
        "if /* a comment */ (co_await f()) g();",
    ],
    2: [
        'co_await send({"hold"});',
        'co_await boat.call(helm, {"hold"}, 2s);',
        'auto r = co_await boat.call(helm, set_mode{"hold"}, 2s);',
        'co_await send(Agg{"x", 1});',
        'co_await send(ns::Agg{.mode = "x", .n = 1});',
        'co_await send(Agg("x", 1));',
        "co_await send(wrap(Agg{}));",
        'co_return co_await send(Agg{"x", 1});',
        "co_await (a({s}) && b());",
        "co_await send(std::vector<std::string>{a, b});",
        'for (auto x : co_await all(Agg{"x", 1})) g(x);',
        'auto r = (co_await send(Agg{"x", 1})).value();',
        'if (ready) co_await send({"hold"});',
        'f(co_await g(), Agg{"x", 1});',
        'auto l = [&]() -> ise::task<> { co_await send({"hold"}); };',
        "co_await send(\n    // the mode\n    {mode},\n    2s);",
        'case 1: co_await send({"x"});',
        "co_await awaiter{std::move(state)};",
    ],
    3: [
        "co_await run([text = std::move(text)] { g(text); });",
        "co_await run([text]() -> ise::task<> { co_await g(text); });",
        "co_await run([=] { g(); });",
        "co_await [text]() -> ise::task<> { co_await g(text); }();",
        "co_await run([this, name] { g(name); });",
        "asio::co_spawn(io, [&x]() -> ise::task<> { co_await g(x); }(), asio::detached);",
        "asio::co_spawn(io, [this]() -> ise::task<> { co_return; }(), asio::detached);",
    ],
    4: [
        "auto x = ok ? co_await f() : 0;",
        "auto x = ok ? 0 : co_await f();",
        "co_await (ok ? f() : g());",
        'co_await send(ok ? name : "nobody");',
        'co_await send(ok ? std::string("a") : std::string("b"));',
        "auto x = ok ? (co_await f()) : 0;",
        "auto x = a ? 1 : b ? co_await f() : 2;",
    ],
    5: [
        "std::vector<int> v{co_await a(), co_await b()};",
        "auto v = std::vector{co_await a()};",
        "use(point{co_await a(), 2});",
        "co_return fix{co_await a(), 1, 2};",
        "int x = {co_await a()};",
    ],
}

SAFE = [
    "bool ok = co_await f(); if (ok) g();",
    "auto packet = co_await fixes.next(); if (!packet) co_return;",
    'set_mode hold{"hold"}; auto reply = co_await boat.call(helm, hold, 2s);',
    'set_mode hold = {"hold"}; co_await boat.call(helm, hold);',
    "co_await send(make_packet());",
    'auto op = send({"hold"}); co_await std::move(op);',
    'co_await helm(boat, "hold");',
    "for (auto x : co_await f()) g(x);",
    "for (const auto& [k, v] : co_await f()) g(k, v);",
    "auto [a, b] = co_await f();",
    "co_await f(co_await g());",
    "try { co_await f(); } catch (const std::exception& e) { g(e); } co_await h();",
    "co_await run([this] { g(); });",
    "co_await run([&] { g(Agg{a, 1}); });",
    "co_await run([] { g({1}); });",
    "co_await run([&x, this]() -> ise::task<> { co_return; });",
    "co_await std::visit([&](auto& t) { return t.run(); }, transport);",
    "co_await sleep(std::chrono::milliseconds{20});",
    "co_await send(std::string{text});",
    "co_await send(fix{28.15, -15.45, 2.1f});",
    "co_await send(ns::track{});",
    "co_await send(made(text));",
    "co_await sleep(fast ? 1 : 2);",
    'co_await send(ok ? "a" : "b");',
    "co_await send(ok ? left : right);",
    "if (ok) { Agg a{x, 1}; co_await send(a); }",
    "if (v == Agg{x, 1}) co_await f();",
    "while (running) { co_await f(); }",
    "for (;;) { co_await sleep(1s); fixes(fix{28.15, -15.45, 2.1f}); }",
    "for (auto first = co_await f(); first; first = g()) h();",
    "if (auto n = co_await f(); n) g();",
    "if (std::any_of(b, e, [&](auto& x) { return x.ok; })) co_await f();",
    'provide(helm, [](set_mode rq) -> ise::task<mode_set> { co_return mode_set{rq.mode != "fly", "boats sail"}; });',
    "provide(helm, [this, name](set_mode rq) -> ise::task<mode_set> { co_await f(); co_return g(name); });",
    "asio::co_spawn(io, [text]() -> ise::task<> { co_await g(text); }, asio::detached);",
    "asio::co_spawn(io, []() -> ise::task<> { co_await g(); }(), asio::detached);",
    "// if (co_await f()) g();",
    "/* co_await send({1}); */",
    'auto s = "if (co_await f()) {"; auto t = R"x(co_await send({"a"}))x";',
    "auto n = 1'000'000; co_await f(n);",
    "x[co_await f()] = table[3];",
    "switch (kind) { case 1: co_await f(); break; default: co_await g(); }",
    "int x = 0; { co_await f(x); }",
    "auto l = [&]() -> ise::task<std::vector<int>> { co_await f(); co_return v; };",
    "co_await asio::async_write(socket, asio::buffer(text), asio::use_awaitable);",
    "awaitable operator co_await();",
    "if (co_await f()) g(); // NOLINT(coroutine): the function has locals, measured",
    "// NOLINTNEXTLINE(coroutine): trivial\nco_await send({1});",
]


class CoroutineLaw(unittest.TestCase):
    def test_each_bad_form_is_caught(self):
        for rule, bodies in BAD.items():
            for body in bodies:
                with self.subTest(rule=rule, body=body):
                    self.assertIn(rule, rules(body))

    def test_each_safe_form_passes(self):
        for body in SAFE:
            with self.subTest(body=body):
                self.assertEqual(rules(body), [])

    def test_a_defaulted_aggregate_argument_of_a_coroutine_is_caught(self):
        for head in ("ise::task<> f(Agg o = {.n = 1});", "ise::task<int> f(int a, Agg o = Agg{});", "asio::awaitable<void> f(Agg o = {});"):
            self.assertEqual(rules("", TYPES + head), [6], head)
        for head in ("ise::task<> f(int n = 3);", "ise::task<> f(std::string s = {});", "ise::task<> f(fix o = {});", "void f(Agg o = {});"):
            self.assertEqual(rules("", TYPES + head), [], head)

    def test_an_excuse_needs_a_reason(self):
        self.assertEqual(rules("if (co_await f()) g(); // NOLINT(coroutine)"), [0])

    def test_other_excuses_do_not_count(self):
        self.assertEqual(rules("if (co_await f()) g(); // NOLINT(readability)"), [1])

    def test_the_line_of_a_finding_is_that_of_the_code(self):
        source = tokenize('#define X \\\n  1\nauto s = R"(a\nb)";\ntask<> f() {\n  co_await\n    send({1});\n}\n')
        self.assertEqual([line for _, line, _ in check(source, AggregateIndex([source]))], [7])


if __name__ == "__main__":
    unittest.main()
