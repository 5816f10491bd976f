#pragma once
#include <string>

namespace atirma {

/// One event of the page's stream, as `track_state` makes it and `sse_channel` sends it.
struct page_event {
    std::string id;   ///< what a client hands back as Last-Event-ID; empty: keeps the one before
    std::string name; ///< "snapshot", "update", "status"; no line breaks
    std::string data; ///< one JSON text
};

} // namespace atirma
