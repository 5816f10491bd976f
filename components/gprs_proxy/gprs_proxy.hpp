#pragma once
#include <components/boat/boat_command.hpp>
#include <components/boat/telecommand_tracker.hpp>
#include <components/boat/telemetry_store.hpp>
#include <components/gprs/shore.hpp>
#include <components/gprs_proxy/services.hpp>

#include <ise/component/component.hpp>

#include <functional>
#include <memory>
#include <optional>

namespace atirma {

struct gprs_proxy_options {
    std::vector<std::string> listen{"tcp://127.0.0.1:7420",
                                    "udp://127.0.0.1:7420"}; ///< where the boat calls; port 0: any free one
    gprs::shore_options shore;
    ise::duration state_period = std::chrono::seconds(2); ///< of gprs_state
    link_policy policy;
    /// Asked before the boat is acknowledged; nothing: what was published is safe.
    std::shared_ptr<telemetry_store> store;
    /// Path or role of who keeps it instead of `store`: `atirma/communication`; empty: nobody.
    std::string store_at;
    /// Key file (seal_store.hpp): telecommands are sealed, and what is not of the boat is dropped. Empty:
    /// everybody on the link is believed.
    std::string radio_key_file;
    bool radio_secondary = false; ///< its counters are those of the secondary lane
    /// File (SQLite) with what was spent; empty: counted since the start only, and without a budget.
    std::string database;
    std::uint64_t daily_budget = 0;                                      ///< bytes a day (UTC), both ways; 0: unlimited
    std::uint64_t monthly_budget = 0;                                    ///< the same for a month
    std::function<void(const std::vector<ise::endpoint>&)> on_listening; ///< on the component's loop
};

/// The boat over GPRS: it calls over TCP or by datagrams, its telemetry is published and, once safe, acknowledged;
/// telecommands go the other way while it is there, and wait within their validity while it is not. Services:
/// `telemetry`, `telecommand`, `telecommand_state` (components/boat/services.hpp), `gprs_state` (services.hpp). An
/// endpoint that is none or is taken ends `run()` with an error that says so.
class gprs_proxy final : public ise::component {
public:
    explicit gprs_proxy(gprs_proxy_options options = gprs_proxy_options());
    ~gprs_proxy() override;

private:
    struct link; // what lives from one run() to the next

    ise::task<> run() override;
    void open_doors();
    void provide_all();
    /// Does what the shore decided, and looks when to come again.
    void act();
    void handle(const gprs::shore_event& event);
    std::optional<ise::bytes> opened(const ise::bytes& raw);
    ise::result<ise::bytes> open(const ise::bytes& raw);
    void on_record(const gprs::record_came& came);
    void on_outcome(const gprs::outcome& result);
    ise::task<> keep();
    bool give();
    ise::result<void> within_budget(const boat_command& command) const;
    void keep_account();
    void publish_state();
    utc_time clock() const;
    utc_time civil(ise::time_point at) const;

    gprs_proxy_options options_;
    std::unique_ptr<link> link_;
};

} // namespace atirma
