#pragma once
#include <string>

namespace ise {

/// One server-sent event.
struct sse_event {
    std::string id;   ///< what a client hands back as Last-Event-ID; empty: keeps the one before
    std::string name; ///< "snapshot", "update", "status"; no line breaks
    std::string data; ///< one JSON text
};

} // namespace ise
