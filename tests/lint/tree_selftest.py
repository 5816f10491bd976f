#!/usr/bin/env python3
"""The lints of the tree on themselves: layering, cycles, environment, names of machines, formatting, comments of asynchronous
functions."""

import tempfile
import unittest
from pathlib import Path, PurePosixPath

import async_docs
import component_names
import cycles
import environment
import format as format_lint
import machine_names
from cpp_tokens import tokenize
from layering import objection


class Layering(unittest.TestCase):
    def test_what_points_up_or_aside_is_refused(self):
        for file, target in [
            ("ise/core/error.hpp", "ise/packet/codec.hpp"),
            ("ise/wire/frame.cpp", "ise/net/connection.hpp"),
            ("ise/name_server/server.cpp", "ise/instantiation/server.hpp"),
            ("ise/core/clock.hpp", "ise/sim/clock.hpp"),
            ("ise/sim/world.cpp", "ise/component/node.hpp"),
            ("ise/net/x.cpp", "components/boat/services.hpp"),
            ("ise/net/x.cpp", "ise/ise.hpp"),
            ("ise/brand_new/x.cpp", "ise/core/error.hpp"),
            ("components/web_server/x.cpp", "components/xbee_proxy/modem.hpp"),
            ("components/boat/x.cpp", "apps/ise/main.hpp"),
            ("components/boat/x.cpp", "tests/support/catch.hpp"),
            ("apps/ise/x.cpp", "apps/name_server/y.hpp"),
        ]:
            self.assertIsNotNone(objection(PurePosixPath(file), PurePosixPath(target)), (file, target))

    def test_what_points_down_passes(self):
        for file, target in [
            ("ise/packet/codec.cpp", "ise/core/error.hpp"),
            ("ise/core/real/tcp.cpp", "ise/core/environment.hpp"),
            ("ise/name_server/server.cpp", "ise/component/component.hpp"),
            ("ise/sim/network.cpp", "ise/core/environment.hpp"),
            ("ise/ise.hpp", "ise/component/component.hpp"),
            ("components/xbee_proxy/x.cpp", "components/xbee/frame.hpp"),
            ("components/web_server/x.cpp", "components/xbee_proxy/services.hpp"),
            ("components/web_server/x.cpp", "components/boat/packets.hpp"),
            ("apps/ise/main.cpp", "ise/ise.hpp"),
            ("tests/unit/net/x.cpp", "ise/sim/world.hpp"),
        ]:
            self.assertIsNone(objection(PurePosixPath(file), PurePosixPath(target)), (file, target))


class AsyncDocs(unittest.TestCase):
    def lacks(self, text):
        return [each.partition("lacks ")[2] for each in async_docs.findings(tokenize(text, "x.hpp"))]

    def test_what_a_comment_lacks_is_found(self):
        for text, lack in [
            ("task<> f();", "a comment"),
            ("/// Waits for it.\ntask<> f();", "what cancellation does"),
            ("class x {\npublic:\n/// Waits for it.\nvirtual task<> f() = 0; };", "what cancellation does"),
            ("/// Waits. Cancellation: terminal.\ntemplate <class T>\nrequires(T::x)\ntask<result<T>> f(T what);", "how it fails"),
            ("/// Waits. Cancellation: terminal.\ntask<> f(std::size_t most);", "what the number 'most' counts"),
            ("/// Waits. Cancellation: terminal.\ntask<> f(const thing& what);", "how long 'what' must live"),
            ("namespace a { struct b { task<int> f(); }; }", "a comment"),
        ]:
            self.assertEqual(self.lacks(text), [lack], text)

    def test_good_comments_and_what_is_not_public_pass(self):
        for text in [
            "/// Waits. Cancellation: terminal.\ntask<> f(duration at_most);",
            "task<> f(); ///< waits for it. Cancellation: terminal",
            "/// Waits. Cancellation: terminal.\ntask<> f();\n/// The same with another.\ntask<> f(int count);",
            "/// Takes at most `most` bytes, or errc::io_failed. Cancellation: terminal.\ntask<result<int>> f(int most);",
            "/// Waits; `what` outlives it. Cancellation: terminal.\ntask<> f(const thing& what);",
            "class x { task<> f(); public: void g(); private: task<> h(); };",
            "class x { public: task<> f() override; std::function<task<>()> make; };",
            "namespace detail { task<> f(); }",
            "inline void g() { task<> f(); }",
        ]:
            self.assertEqual(self.lacks(text), [], text)


class ComponentNames(unittest.TestCase):
    def test_all_members_are_found(self):
        text = """
        class component;
        class component : public runnable {
        public:
            component();
            ~component() override;
            const std::string& path() const noexcept;
            template <class Contract, class Handler>
            void provide(const Contract& service, Handler handler, options how = options()) { add(service); }
            task<> run() override = 0;
        private:
            static void tick();
            std::map<int, int> known_;
            bool over_ = false;
        };
        void outside();
        """
        self.assertEqual(component_names.members(tokenize(text).tokens, "component"), {"path", "provide", "run", "tick", "known_", "over_"})


class Format(unittest.TestCase):
    def test_long_lines_are_found_but_for_strings(self):
        for text, lines in [
            ("int a;" + " " * 120 + "\n", [1]),
            ("// " + "x" * 118 + "\nint a;\n", [1]),
            ("// " + "ä" * 117 + "\n", []),
            (f'auto a = "{"x" * 120}";\n', []),
            ('auto a = R"(\n' + "x" * 121 + ')";\n', []),
            ('auto a = "x";\n' + "// " + "x" * 118 + "\n", [2]),
        ]:
            found = [int(each.split(":")[1]) for each in format_lint.long_lines("x.cpp", text)]
            self.assertEqual(found, lines, text)

    @unittest.skipUnless(format_lint.clang_format(), "clang-format 14 is not installed")
    def test_what_clang_format_would_write_otherwise_is_found(self):
        with tempfile.TemporaryDirectory() as folder:
            root = Path(folder)
            (root / ".clang-format").write_text("BasedOnStyle: LLVM\n")
            (root / "good.cpp").write_text("int a;\n")
            (root / "bad.cpp").write_text("int  a ;\n")
            found = format_lint.unformatted(format_lint.clang_format(), root, ["good.cpp", "bad.cpp"])
            self.assertEqual([each.split(":")[0] for each in found], ["bad.cpp"])


class Cycles(unittest.TestCase):
    def found(self, files):
        with tempfile.TemporaryDirectory() as folder:
            for name, text in files.items():
                path = Path(folder) / name
                path.parent.mkdir(parents=True, exist_ok=True)
                path.write_text(text)
            return list(cycles.findings(cycles.modules(Path(folder))))

    TIED = {
        "ise/a.hpp": "", "ise/a.cpp": "#include <ise/a.hpp>\n#include <ise/b.hpp>\n", "ise/b.hpp": "#include <ise/c.hpp>",
        "ise/c.hpp": "", "ise/c.cpp": '#include "c.hpp"\n#include "a.hpp"', "ise/above.hpp": "#include <ise/a.hpp>",
    }

    def test_a_cycle_is_found_with_the_includes_that_close_it(self):
        self.assertEqual(self.found(self.TIED), [
            "a cycle of 3 modules: ise/a ise/b ise/c", "  ise/a.cpp:2 includes ise/b.hpp", "  ise/b.hpp:1 includes ise/c.hpp",
            "  ise/c.cpp:2 includes ise/a.hpp",
        ])
        tied = {"tests/x/one.hpp": '#include "two.hpp"', "tests/x/two.hpp": "#include <x/one.hpp>"}
        self.assertEqual(self.found(tied)[0], "a cycle of 2 modules: tests/x/one tests/x/two")

    def test_what_makes_none_passes(self):
        self.assertEqual(self.found({
            "ise/a.hpp": "#include <ise/b.hpp>", "ise/a.cpp": "#include <ise/a.hpp>", "ise/b.hpp": "// #include <ise/a.hpp>",
            "ise/both.hpp": "#include <ise/a.hpp>\n#include <ise/b.hpp>",
            "tests/x/memory.cpp": '#include "system.hpp"', "tests/x/system.hpp": "#include <memory>",
        }), [])


class Environment(unittest.TestCase):
    def found(self, code):
        return [line for line, _ in environment.findings_in(tokenize(code))]

    def test_reaching_around_the_environment_is_found(self):
        for code in [
            "auto t = std::chrono::steady_clock::now();", "auto t = clock::system_clock::now();",
            "auto t = clock::now();",
            "std::this_thread::sleep_for(1s);", "::sleep(1);", "usleep(3);", "asio::steady_timer t(io);",
            "std::random_device d;", 'auto v = std::getenv("HOME");', "asio::ip::tcp::socket s(io);",
            "tcp::acceptor a(io);", "asio::local::stream_protocol::socket s(io);", "asio::serial_port p(io);",
            "int f = ::socket(AF_INET, 0, 0);", "std::ifstream f(p);", "auto f = fopen(p, m);",
            "std::filesystem::remove(p);", "auto t = std::time(nullptr);", "::kill(pid, 9);", "return ::open(p, 0);",
        ]:
            self.assertEqual(self.found("\n" + code), [2], code)

    def test_what_does_not_reach_out_passes(self):
        for code in [
            "co_await sleep(1s);", "auto t = environment.now();", "std::chrono::steady_clock::time_point t;",
            "clock().now();", "std::filesystem::path p;", "asio::ip::tcp::endpoint e;", "// steady_clock::now()",
            'auto s = "getenv(x)";', "stream.connect(endpoint);", "listener->open();", "std::mt19937 r(seed);",
            "void link::connect(int) {}", "time_point loop::now() const { return t_; }", "auto loop::now() noexcept -> t {}", "link.open(1);",
        ]:
            self.assertEqual(self.found(code), [], code)

    def test_a_boundary_needs_a_reason(self):
        body = "\nauto t = std::chrono::steady_clock::now();"
        self.assertEqual(self.found("// environment-boundary: owns its sockets" + body), [])
        self.assertEqual(self.found("// environment-boundary:" + body), [1])
        self.assertEqual(self.found(body + " // NOLINT(environment): measures itself"), [])


class MachineNames(unittest.TestCase):
    def test_hosts_and_folders_are_found(self):
        for line in ['"resol' 'ved": "https://regis' 'try.npmjs.org/x"', "see /home/jane/ise", '"/wo' 'rk/main/x"', "cd /root", "(/wo" "rk/x)"]:
            self.assertTrue(list(machine_names.findings_in(line)), line)

    def test_ordinary_lines_pass(self):
        for line in ["ISE_BINARY_DIR/work/x", "tests/work/x", "${root}/work/y", "/dev/ttyUSB0", "/tmp/x", "the root/work", "/homework", "https://a.b/root/x"]:
            self.assertFalse(list(machine_names.findings_in(line)), line)


if __name__ == "__main__":
    unittest.main()
