#pragma once
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace ise::cli {

/// A span as a file has it.
struct traced_span {
    std::string trace, id, parent; ///< hexadecimal; no parent: the root
    std::string component;         ///< whose side it is
    std::string name;              ///< the service
    std::string peer;              ///< the other side
    std::string kind;              ///< "client", "server", "producer", "consumer" or "internal"
    std::string linked;            ///< the trace that goes on with it, if it is another one
    std::string outcome;           ///< "ok", or the name of the error
    std::int64_t began_ns = 0;     ///< since 1970
    std::int64_t took_ns = 0;
};

/// Appends the spans of OTLP/JSON, one request a line; a last line that is not complete yet is left out. Errors:
/// malformed, with the line.
result<void> read_spans(std::string_view text, std::vector<traced_span>& into);

/// Those of one trace, and of the traces that it is linked to; `trace`: the beginning of its id; empty: the one that
/// began last, and that no other is linked to. Ordered by their begin, those of the trace itself first.
std::vector<traced_span> spans_of_trace(const std::vector<traced_span>& all, std::string_view trace);

/// As a tree with times, for people.
std::string draw_trace(const std::vector<traced_span>& spans);

} // namespace ise::cli
