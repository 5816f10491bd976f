#pragma once
#include <components/boat/duplicate_filter.hpp>
#include <components/boat/services.hpp>
#include <components/gprs_proxy/services.hpp>
#include <components/xbee_proxy/services.hpp>

#include <ise/component/component.hpp>

#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

struct observer_options {
    std::string proxy = "atirma/shore/xbee"; ///< whose telecommands are used
    std::vector<std::string> telemetry;      ///< of which proxies; empty: of that one
    std::optional<ise::endpoint> page;       ///< tcp, of a web server; nothing: no page is looked at
    ise::duration length = std::chrono::seconds(30);
    ise::duration ping_period = std::chrono::seconds(3);
};

/// What was seen.
struct observation {
    std::map<std::string, std::uint64_t> telemetry; ///< by type
    std::map<std::string, std::uint64_t> links;     ///< the same packets by link
    std::uint64_t history = 0, twice = 0;           ///< of these late; besides these, packets that had been there
    duplicate_filter known;
    std::uint64_t lost = 0; ///< published, and not received here
    std::uint64_t telecommands = 0, acknowledged = 0, pending = 0, failed = 0;
    std::uint64_t page_updates = 0; ///< events with telemetry that the page's stream brought
    std::string page_trouble;
    std::optional<xbee_local> local;
    std::optional<gprs_state> gprs;

    bool page_is_live() const noexcept { return page_updates > 0; }
    bool boat_answered() const noexcept { return acknowledged > 0; }
    std::string text() const;
};

/// Looks at the running system as its users do, for a while: subscribes to telemetry, pings the boat by telecommand,
/// reads the page's event stream; then stops its component.
class observer final : public ise::component {
public:
    observer(observer_options options, std::shared_ptr<observation> into)
        : options_(std::move(options)), seen_(std::move(into)) {}

private:
    ise::task<> run() override;
    ise::task<> follow_telemetry(std::string from);
    ise::task<> follow_modem();
    ise::task<> follow_gprs(std::string from);
    ise::task<> ping();
    ise::task<> read_page();
    ise::task<std::string> read_stream(ise::endpoint from);

    observer_options options_;
    std::shared_ptr<observation> seen_;
};

} // namespace atirma
