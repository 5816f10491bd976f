#pragma once
#include <components/mqtt_bridge/bridge_context.hpp>
#include <components/mqtt_bridge/call_journal.hpp>
#include <components/mqtt_bridge/outgoing_messages.hpp>

#include <ise/core/task.hpp>
#include <ise/database/database.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/dynamic.hpp>

#include <cstddef>
#include <cstdint>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <string_view>
#include <utility>

namespace ise::mqtt {

/// The request-response services that MQTT clients call (`allow-calls`): reads their requests, executes each once by
/// the journal, and hands the answers to `outgoing_messages`. Used on the component's loop.
class client_calls : public std::enable_shared_from_this<client_calls> {
public:
    /// `life`: as that of `call_journal`, whose tables `disk` has.
    client_calls(std::shared_ptr<bridge_context> in, std::shared_ptr<outgoing_messages> to,
                 std::shared_ptr<database> disk, std::uint64_t life);

    /// A component is shown, whatever it provides.
    void add_component(const std::string& path) { paths_.insert(path); }
    void remove_component(const std::string& path) { paths_.erase(path); }
    /// `path` provides `service`. Throws ise::error for a type that protobuf cannot have.
    void add(const std::string& path, const dynamic_contract& service);
    void remove(const std::string& path, const std::string& service) { all_.erase({path, service}); }

    /// A request of a client.
    void take(message asked);
    /// Forgets requests that are too old.
    void tidy();

private:
    struct callable;
    static task<> call(std::shared_ptr<client_calls> me, std::shared_ptr<callable> service, dynamic_packet request,
                       message asked);
    /// Why a request with this response topic gets no answer, and so is not executed; empty: it gets one.
    std::string unanswerable(std::string_view topic) const;
    void answer(const message& asked, const call_outcome& outcome);
    void refuse(const message& asked, errc code, std::string why);

    std::shared_ptr<bridge_context> in_;
    std::shared_ptr<outgoing_messages> to_;
    std::shared_ptr<database> disk_; // the journal points to it
    call_journal journal_;
    std::set<std::string> paths_;
    std::map<std::pair<std::string, std::string>, std::shared_ptr<callable>> all_; // by path and service
    std::size_t calls_ = 0;                                                        // now
};

} // namespace ise::mqtt
