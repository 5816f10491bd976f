#pragma once
#include <components/web_server/boat_page.hpp>
#include <ise/http/http_server.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace atirma {

/// The limits of a public page: many viewers, no posts.
ise::http_limits page_limits();

struct page_address {
    std::string address = "127.0.0.1"; ///< numeric, IPv4 or IPv6
    std::uint16_t port = 8080;         ///< 0: the system chooses
    ise::http_limits limits = page_limits();
};

struct web_server_options {
    page_address http;
    std::vector<std::string> telemetry;  ///< of the first boat, see `boat_source`; its name is `track.boat`
    std::vector<std::string> more_boats; ///< each as `parse_boat` reads it: "Vela=vela/communication"
    std::size_t boats = 1;               ///< of a fleet (docs/fleet.md): so many, by their names, before `more_boats`
    track_options track;                 ///< its `epoch` is chosen anew at each start, `id` from the name
    tile_source tiles;                   ///< a chart below the page's own coastline; none by default
    archive_options archive; ///< without a file nothing outlives a restart but what communication nodes keep
    std::function<void(const std::string& url)> on_listening; ///< on the component's loop
};

/// The public tracking page: subscribes to the `telemetry` of each boat, keeps its state and track, in memory and on
/// disk, and serves page, events and downloads. Who is not there is waited for, and the page says so. When the port is
/// taken, when a boat cannot be called so, or when the archive cannot be opened, `run()` ends with an error that says
/// so.
class web_server final : public ise::component {
public:
    explicit web_server(web_server_options options = web_server_options());
    ~web_server() override;

    // On the component's loop; of the first boat.
    const track_state& state() const noexcept { return boats_.front()->state(); }
    const feed_statistics& statistics() const noexcept { return boats_.front()->feed().statistics(); }
    /// The number of events that the page's clients were told.
    std::uint64_t events_published() const noexcept { return boats_.front()->events(); }
    const std::vector<std::unique_ptr<boat_page>>& boats() const noexcept { return boats_; }

private:
    ise::task<> run() override;
    void make_boats();
    void forget_boats();
    void listen();
    void fill_archive();
    void keep();
    void tick();
    std::string fleet_json() const;
    std::string status_json() const;
    utc_ms clock() const;

    web_server_options options_;
    std::unique_ptr<track_archive> archive_;
    std::vector<std::unique_ptr<boat_page>> boats_;
    std::unique_ptr<ise::http_server> server_;
    std::vector<std::pair<std::string, ise::sse_channel*>> streams_; ///< by path
    bool disk_failed_ = false;
    std::uint64_t archives_filled_ = 0; ///< that were begun anew
};

} // namespace atirma
