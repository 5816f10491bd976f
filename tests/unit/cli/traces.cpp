#include <apps/ise/span_tree.hpp>

#include <support/catch.hpp>

#include <string>
#include <vector>

namespace {

using ise::cli::traced_span;

// As a program writes it: an OTLP request with one span.
std::string line_of(const std::string& component, const std::string& trace, const std::string& id,
                    const std::string& parent, const std::string& name, int kind, int at_us, int took_us,
                    const std::string& peer = "", const std::string& linked = "") {
    auto nanoseconds = [](int us) { return "\"" + std::to_string(1'000'000'000LL + us * 1'000LL) + "\""; };
    const char* peer_key = kind == 2 ? "client.address" : kind == 1 ? "work.target" : "server.address";
    std::string attributes;
    if (!peer.empty())
        attributes = R"({"key":")" + std::string(peer_key) + R"(","value":{"stringValue":")" + peer + R"("}})";
    return R"({"resourceSpans":[{"resource":{"attributes":[{"key":"service.name","value":{"stringValue":")" +
           component + R"("}}]},"scopeSpans":[{"scope":{"name":"ise"},"spans":[{"traceId":")" + trace +
           R"(","spanId":")" + id + (parent.empty() ? "" : R"(","parentSpanId":")" + parent) + R"(","name":")" + name +
           R"(","kind":)" + std::to_string(kind) + R"(,"startTimeUnixNano":)" + nanoseconds(at_us) +
           R"(,"endTimeUnixNano":)" + nanoseconds(at_us + took_us) + R"(,"attributes":[)" + attributes + "]" +
           (linked.empty() ? "" : R"(,"links":[{"traceId":")" + linked + R"(","spanId":"b1"}])") +
           R"(,"status":{"code":1}}]}]}]})" + "\n";
}

std::vector<traced_span> read(const std::string& text) {
    std::vector<traced_span> all;
    ise::cli::read_spans(text, all).value();
    return all;
}

TEST_CASE(
    "a trace is drawn with its packets, and with the trace that it is linked to below the span that goes on there") {
    auto all = read(line_of("sea/boat", "bb", "b1", "", "executes hold", 1, 900, 0) +
                    line_of("sea/console", "aa", "01", "", "telecommand", 3, 0, 1000, "sea/node") +
                    line_of("sea/node", "aa", "02", "01", "telecommand", 2, 10, 900) +
                    line_of("sea/node", "aa", "03", "02", "news", 4, 20, 0) +
                    line_of("sea/page", "aa", "04", "03", "news", 5, 30, 5, "sea/node") +
                    line_of("sea/xbee", "aa", "05", "02", "hold over xbee", 1, 100, 700, "the boat", "bb") +
                    line_of("sea/other", "cc", "11", "", "before", 3, -500, 1));
    auto spans = ise::cli::spans_of_trace(all, ""); // of the boat's the begin is later, and it is no trace of its own
    CHECK(ise::cli::draw_trace(spans) == "trace aa, 1970-01-01T00:00:01Z, 1 ms, 6 spans\n"
                                         "sea/console calls 'telecommand' of sea/node   at 0 us, 1 ms\n"
                                         "└─ sea/node answers 'telecommand'   at 10 us, 900 us\n"
                                         "   ├─ sea/node publishes 'news'   at 20 us\n"
                                         "   │  └─ sea/page takes 'news' of sea/node   at 30 us, 5 us\n"
                                         "   └─ sea/xbee: hold over xbee to the boat   at 100 us, 700 us\n"
                                         "      └─ sea/boat: executes hold   at 900 us, 0 us\n");
    CHECK(ise::cli::spans_of_trace(all, "bb").size() == 1);
}

TEST_CASE("traces that are linked in a ring, and spans that are linked to themselves, are drawn once") {
    auto all = read(line_of("a", "aa", "01", "", "one", 1, 0, 1, "", "bb") +
                    line_of("b", "bb", "02", "", "two", 1, 1, 1, "", "aa") +
                    line_of("c", "cc", "03", "", "three", 1, 2, 1, "", "cc"));
    CHECK(ise::cli::spans_of_trace(all, "aa").size() == 2);
    CHECK(ise::cli::draw_trace(ise::cli::spans_of_trace(all, "aa")) == "trace aa, 1970-01-01T00:00:01Z, 2 us, 2 spans\n"
                                                                       "a: one   at 0 us, 1 us\n"
                                                                       "└─ b: two   at 1 us, 1 us\n");
    CHECK(ise::cli::spans_of_trace(all, "cc").size() == 1);
}

} // namespace
