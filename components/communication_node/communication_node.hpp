#pragma once
#include <components/communication_node/command_router.hpp>
#include <components/communication_node/options.hpp>
#include <components/communication_node/services.hpp>

#include <ise/component/component.hpp>

#include <memory>
#include <string>
#include <vector>

namespace atirma {

struct node_core;

/// The boat over all links together: keeps every packet of all proxies once, tells them on, takes the telecommands of
/// all operators, and knows who has the authority. Two of them back each other. Services: those of a proxy
/// (components/boat/services.hpp), `telemetry_store`, and components/boat/communication.hpp.
///
/// A store that cannot be opened is tried again, and the log says why; that of a newer program ends `run()` with an
/// error. A damaged store is set aside (renamed, never deleted), and a new one is filled from what is sound in it and
/// from the other node; the log and `communication_state` report it. While the disk takes nothing packets wait in
/// memory, nothing is acknowledged, and the other node serves the role.
class communication_node final : public ise::component {
public:
    explicit communication_node(communication_node_options options = communication_node_options());
    ~communication_node() override;

    /// On the component's loop; nothing before its store is open.
    communication_state how() const;

private:
    ise::task<> run() override;
    void provide_all();
    void require_all();
    void tick();
    void consider_serving();
    utc_time clock() const;
    void disk(const ise::failure* why);

    // node_repair.cpp
    ise::task<> open_store();
    void replace_store(const ise::failure& why);
    void begin_store_anew();
    void begin_salvage(const std::string& file);
    ise::task<> salvage(std::string file);
    bool take_salvaged(const std::vector<command_record>& records);
    bool take_salvaged(const std::vector<telemetry_packet>& packets);
    void went_back(const store_part& known_there, const store_part& shared);
    /// Every answer of the store passes here that does not pass `disk`: one that shows damage has it replaced.
    template <class T>
    void look_for_damage(const ise::result<T>& answer) {
        if (!answer && answer.error().code() == ise::errc::malformed) replace_store(answer.error());
    }

    // node_telemetry.cpp
    ise::task<> follow_telemetry(std::size_t proxy);
    void unreached(std::size_t which, const ise::error& problem);
    ise::result<std::uint64_t> take(std::vector<telemetry_packet> packets);
    void take_or_hold(std::vector<telemetry_packet> packets);
    void take_held();
    void show();
    void note_fix(const telemetry_packet& packet);
    ise::task<keep_reply> keep(keep_request request);
    track_page track(const track_request& request);

    // node_peer.cpp
    ise::task<> follow_peer();
    ise::result<void> take_page(replication_page page);
    ise::result<std::vector<command_record>> news_among(const std::vector<command_record>& records);
    void know_all(const std::vector<command_record>& news);
    ise::task<replication_page> tell_peer(replication_request request);

    // node_commands.cpp
    void work();
    void put_changes();
    ise::task<> drive(command_router::give what);
    ise::task<> recall(command_router::recall what);
    ise::task<> follow_states(std::size_t proxy);
    ise::result<void> begin_command(const command_record& record);
    ise::task<telecommand_reply> command(telecommand_request request, std::string who, ise::time_point deadline);
    ise::task<authority_state> change_authority(authority_request request, std::string who);
    void announce_authority();
    record_page record(const record_request& request);

    communication_node_options options_;
    std::unique_ptr<node_core> core_;
};

} // namespace atirma
