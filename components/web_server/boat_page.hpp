#pragma once
#include <components/boat/telemetry_follower.hpp>
#include <components/web_server/boat_source.hpp>
#include <components/web_server/page_data.hpp>
#include <components/web_server/telemetry_feed.hpp>
#include <components/web_server/track_archive.hpp>
#include <ise/http/http_server.hpp>

#include <ise/component/component.hpp>

#include <map>
#include <memory>
#include <set>
#include <string>

namespace atirma {

/// One boat on the page: follows its telemetry, its links' health and its rough Iridium fixes, keeps its state, and
/// tells who watches it. On the loop of the component that it belongs to, which outlives it.
class boat_page {
public:
    /// `archive` may be null.
    boat_page(ise::component& self, boat_source source, track_options options, track_archive* archive);

    /// Takes up what the archive has of this boat. Throws ise::error where the disk fails.
    void restore();
    /// Starts to follow, as coroutines of the component.
    void follow();
    /// Its address, data, streams and downloads; `first`: also under the addresses without a boat. Adds its streams to
    /// `streams`.
    void offer(ise::http_server& server, bool first, const page_extras& extras,
               std::vector<std::pair<std::string, ise::sse_channel*>>& streams);
    /// The streams of `offer` are gone.
    void withdraw() noexcept { streams_.clear(); }

    void publish(const ise::sse_event& event);
    /// Subscriptions heal by themselves: that one is cut off shows only when looked at, once a second.
    void watch();
    /// To the archive: how far its providers were followed. Before each commit.
    void keep_progress();

    /// The archive lost what it had: gives it the track, and asks the providers for everything else once more.
    void fill_archive();

    const boat_source& source() const noexcept { return source_; }
    const track_state& state() const noexcept { return state_; }
    const telemetry_feed& feed() const noexcept { return feed_; }
    const std::map<std::string, bool>& links() const noexcept { return links_; }
    std::uint64_t events() const noexcept { return events_; }

private:
    ise::task<> follow_telemetry(std::string path);
    ise::task<bool> offers(ise::remote provider, std::string service);
    ise::task<> follow_health(std::string path);
    ise::task<> follow_estimates(std::string path);
    void look_for_estimates(const std::string& path);
    void show_health(const communication_state& node);
    void show_feed(feed_update result);
    void show_connection(const std::string& path, bool connected, std::string detail);
    utc_ms clock() const;

    ise::component& self_;
    boat_source source_;
    track_archive* archive_;
    track_state state_;
    telemetry_feed feed_;
    std::vector<ise::sse_channel*> streams_;
    std::map<std::string, bool> links_; ///< by path: whether telemetry can come now
    std::map<std::string, telemetry_follower*> followers_;
    std::set<std::string> nodes_;     ///< paths of roles that told of several links
    std::set<std::string> estimates_; ///< paths that are asked for rough fixes
    std::uint64_t events_ = 0;
};

} // namespace atirma
