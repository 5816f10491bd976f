#pragma once
#include <components/foxglove_gateway/advertisements.hpp>
#include <components/foxglove_gateway/gateway_context.hpp>
#include <components/foxglove_gateway/viewer_sessions.hpp>

#include <ise/core/task.hpp>
#include <ise/service/dynamic.hpp>

#include <map>
#include <memory>
#include <string>
#include <utility>

namespace ise::foxglove {

/// The request-response services that viewers call (`allow-calls`). Used on the component's loop.
class shown_services : public std::enable_shared_from_this<shown_services> {
public:
    shown_services(std::shared_ptr<gateway_context> in, std::shared_ptr<viewer_sessions> to)
        : in_(std::move(in)), to_(std::move(to)) {}

    /// `path` provides `service`. Throws ise::error for a type that protobuf cannot have.
    void add(const std::string& path, const dynamic_contract& service);
    /// Not any more, or with other packets.
    void remove(const std::string& path, const std::string& service);
    /// Tells viewers what was added and removed since the last time.
    void announce();
    std::shared_ptr<const std::string> list(); ///< the message with all of them, for a new viewer

    void take(const std::shared_ptr<viewer>& who, call_message& asked);

private:
    struct callable;
    static task<> call(std::shared_ptr<shown_services> me, std::shared_ptr<viewer> who,
                       std::shared_ptr<callable> service, call_message asked, viewer_sessions::operation under_way);

    std::shared_ptr<gateway_context> in_;
    std::shared_ptr<viewer_sessions> to_;
    std::map<std::pair<std::string, std::string>, std::shared_ptr<callable>> all_; // by path and service
    advertisements<std::shared_ptr<callable>, service_info> advertised_{write_advertise_services,
                                                                        write_unadvertise_services};
};

} // namespace ise::foxglove
