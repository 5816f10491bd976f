#pragma once
#include <components/foxglove_gateway/gateway_context.hpp>
#include <components/foxglove_gateway/protocol.hpp>
#include <components/foxglove_gateway/viewer.hpp>

#include <ise/core/task.hpp>
#include <ise/http/http_server.hpp>

#include <cstddef>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <utility>

namespace ise::foxglove {

/// The viewers that are connected: lets them in, reads what they ask for, and disconnects those that do not read. Used
/// on the component's loop.
class viewer_sessions : public std::enable_shared_from_this<viewer_sessions> {
public:
    /// What the gateway does about viewers; outlives the sessions.
    struct events {
        std::function<void(viewer&)> joined;
        std::function<void(const std::shared_ptr<viewer>&, client_message&)> received;
        std::function<void(viewer&)> left;
    };
    viewer_sessions(std::shared_ptr<gateway_context> in, events on) : in_(std::move(in)), on_(std::move(on)) {}

    /// The answer to a request for a WebSocket.
    http_response admit(const http_request& asked);

    void tell_all(std::string message);
    /// Calls `work` for each viewer.
    template <class Work>
    void each(Work work) {
        for (auto& [raw, one] : all_) work(*one.who);
    }
    const std::string& peer_of(const viewer& who) const { return all_.at(&who).peer; } ///< its address
    static void refuse(viewer& who, std::string_view why);

    /// Something that is answered later; counts until it is destroyed.
    class operation {
    public:
        operation(std::shared_ptr<viewer_sessions> in, std::shared_ptr<viewer> who);
        operation(operation&&) noexcept = default;
        operation& operator=(operation&&) = delete;
        ~operation();

    private:
        std::shared_ptr<viewer_sessions> in_;
        std::shared_ptr<viewer> who_;
    };
    /// Nothing: too much at once.
    std::optional<operation> begin(const std::shared_ptr<viewer>& who);
    static std::string too_much(const viewer& who); ///< the reason for it

    /// Disconnects viewers that do not read, and reports skipped messages to the others.
    void tick();
    /// Enters viewers, and messages to those that are here.
    void count_into(gateway_status& to) const;

private:
    struct connection {
        std::shared_ptr<viewer> who;
        std::weak_ptr<web_socket> over;
        std::string peer;
        time_point told_at{};
    };
    static task<> talk(std::shared_ptr<viewer_sessions> me, std::shared_ptr<web_socket> over, std::string peer);
    void leave(viewer& who);
    void check(viewer& who);

    std::shared_ptr<gateway_context> in_;
    events on_;
    std::map<const viewer*, connection> all_;
    std::size_t operations_ = 0;
};

} // namespace ise::foxglove
