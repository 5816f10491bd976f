#include <ise/component/observing.hpp>

namespace ise::detail {

std::unique_ptr<observing> serve_metrics(node_state&, const endpoint& at) {
    throw error(errc::io_failed, "metrics cannot be served at " + at.text() +
                                     ": this ISE was built without HTTP (Debian: libhttp-parser-dev)");
}

std::unique_ptr<span_sink> make_span_poster(loop&, const std::string& url) {
    throw error(errc::io_failed, "spans cannot be sent to '" + url.substr(0, 200) +
                                     "': this ISE was built without HTTP (Debian: libhttp-parser-dev); name a file");
}

} // namespace ise::detail
