#pragma once
#include <components/gui_client/followed_stream.hpp>

#include <ise/naming/services.hpp>

#include <functional>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace atirma::console {

/// Finds the components of a namespace by a name server, and shows them in the state.
class provider_search {
public:
    /// A component, and the names of the services that it provides. Called again when these change.
    using found = std::function<void(const std::string& path, const std::set<std::string>& services)>;
    /// Without a name server nothing is found.
    provider_search(client_context& context, std::string space, std::vector<ise::endpoint> name_servers,
                    found on_found);

    void start();
    bool uses_names() const noexcept { return !name_servers_.empty(); }
    const stream_health& health() const noexcept { return health_; }

private:
    void on_names(const ise::naming::name_events& result);
    ise::task<> look_at(std::string path);
    ise::remote server() const;

    client_context& context_;
    std::string space_;
    std::vector<ise::endpoint> name_servers_;
    found on_found_;
    stream_health health_;
    std::map<std::string, present_component> present_;
    /// By path: the incarnation, and how many services it had.
    std::map<std::string, std::pair<std::uint64_t, std::uint32_t>> looked_at_;
};

} // namespace atirma::console
