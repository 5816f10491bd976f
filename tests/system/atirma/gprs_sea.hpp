#pragma once
#include "sea.hpp"

#include <components/gprs_link/gprs_link_emulator.hpp>
#include <components/gprs_proxy/gprs_proxy.hpp>

#include <map>

/// The sea with a second link: the boat also calls over GPRS, through a carrier, the proxy of that link.
class gprs_sea : public sea {
public:
    explicit gprs_sea(const std::string& protocol = "tcp", std::uint64_t seed = 7);

    atirma::gprs_proxy_options gprs_options;
    atirma::gprs_link_options carrier_options;

    ise::sim::process& gprs_process() { return *gprs_; }
    static ise::remote gprs(ise::component& self) { return self.at(where("shore", 7415)); }
    static ise::remote carrier(ise::component& self) { return self.at(where("carrier", 7416)); }

    /// What a console was told over GPRS since it was asked to watch.
    struct watched_link {
        std::vector<atirma::telemetry_packet> telemetry; ///< in the order of arrival, each once
        std::uint64_t again = 0, lost = 0;
        atirma::duplicate_filter known;
        std::vector<atirma::telecommand_status> states;
        std::optional<atirma::gprs_state> state;
        std::optional<atirma::ground_truth> truth;
    };
    watched_link& watch_gprs();
    /// Asks the carrier for something, and waits until it has done so.
    void carrier_does(const atirma::carrier_request& request);
    void radio(bool up);
    using asked = std::optional<ise::result<atirma::telecommand_reply>>;
    void command(atirma::telecommand_request request, ise::duration deadline, asked& into, bool by_gprs = true);
    /// A page that listens to both proxies.
    atirma::web_server& start_page_of_both();

    /// No packet that was acknowledged to the boat is missing at the console, and none waits aboard.
    bool whole() const;

private:
    ise::sim::process* gprs_ = nullptr;
    watched_link link_;
};
