#pragma once
#include <components/boat/telemetry_follower.hpp>
#include <components/web_server/http_server.hpp>
#include <components/web_server/telemetry_feed.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace atirma {

struct web_server_options {
    http_options http;
    std::vector<std::string> telemetry;        ///< paths of the proxies whose `telemetry` is shown, or the role of the communication nodes
    track_options track;                       ///< its `epoch` is chosen anew at each start
    bool headless = false;                     ///< keeps the state and opens no port: for the virtual world
    std::function<void(const std::string& url)> on_listening; ///< on the component's loop
};

/// The public tracking page: subscribes to the `telemetry` of the proxies, keeps the boat's state and track, and serves page
/// and events. A proxy that is not there is waited for, and the page says so. It needs a loop on an `io_context` (a thread
/// of its own, as components have by default): else, and when the port is taken, `run()` ends with an error that says so.
class web_server final : public ise::component {
public:
    explicit web_server(web_server_options options = web_server_options());
    ~web_server() override;

    // On the component's loop.
    const track_state& state() const noexcept { return *state_; }
    const feed_statistics& statistics() const noexcept { return feed_->statistics(); }
    /// The number of events that the page's clients were told.
    std::uint64_t events_published() const noexcept { return events_; }

private:
    ise::task<> run() override;
    void listen();
    ise::task<> follow(std::string path);
    void publish(const page_event& event);
    void watch_links();
    void show_link(const std::string& path, bool connected, std::string detail);
    std::string status_json() const;
    utc_ms clock() const;

    web_server_options options_;
    std::unique_ptr<track_state> state_;
    std::unique_ptr<telemetry_feed> feed_;
    std::unique_ptr<http_server> server_;
    sse_channel* events_out_ = nullptr;
    std::map<std::string, bool> links_; ///< by path: whether telemetry can come now
    std::map<std::string, const telemetry_follower*> followers_;
    std::uint64_t events_ = 0;
};

} // namespace atirma
