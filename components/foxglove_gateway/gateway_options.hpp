#pragma once
#include <components/foxglove_gateway/derived_channels.hpp>
#include <components/foxglove_gateway/viewer.hpp>

#include <ise/component/system_watch.hpp>
#include <ise/core/endpoint.hpp>

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace ise::foxglove {

/// The rights of viewers, and what is shown to them. By default they only read, and only from this host.
struct gateway_options : service_selection {
    std::string address = "127.0.0.1"; ///< numeric, to listen on
    std::uint16_t port = 8765;         ///< 0: the system chooses
    /// Origins of pages that may connect beside Foxglove's and those of this host; "*": any page. Programs send none.
    std::vector<std::string> origins;
    std::uint32_t max_viewers = 256; ///< at once

    bool allow_calls = false;      ///< viewers call services
    bool allow_parameters = false; ///< viewers set parameters; they read them in any case
    bool allow_publish = false;    ///< viewers publish (`published_service`)
    duration call_deadline = std::chrono::seconds(10);

    std::string assets;                                       ///< folder of files that viewers may fetch; empty: none
    std::size_t max_asset_bytes = std::size_t{16} << 20;      ///< of one
    viewer_limits viewer;                                     ///< of each
    std::vector<endpoint> name_servers;                       ///< default: ISE_NAME_SERVER, else that of this machine
    std::vector<derivation_maker> derivations;                ///< of the application
    std::function<void(const std::string& url)> on_listening; ///< on the component's loop
};

} // namespace ise::foxglove
