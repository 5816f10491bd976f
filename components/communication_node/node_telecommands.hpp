#pragma once
#include <components/boat/recall.hpp>
#include <components/boat/telecommand_audience.hpp>
#include <components/communication_node/boat_links.hpp>
#include <components/communication_node/command_router.hpp>
#include <components/communication_node/node_authority.hpp>

#include <ise/core/trace_id.hpp>

#include <map>
#include <optional>
#include <string>
#include <vector>

namespace atirma {

/// The telecommands at this node: accepts them from operators, records each change, and gives them to the links.
class node_telecommands {
public:
    node_telecommands(node_context& here, store_keeper& store, other_node& peer, boat_links& links,
                      node_authority& authority, const opened_store& opened);

    /// Gives what is due to the links, records and publishes what changed, and arms its timer for the next time.
    void work();
    void on_status(link_id link, const telecommand_status& status);
    /// The other node, or `from` of several, is silent: its open telecommands become ours.
    void take_over(const std::string& from = {}) {
        router_.take_over(here_.now(), here_.clock(), here_.self.path(), from);
    }
    /// A ping under the new epoch: from then on the boat refuses what is under way under the old one.
    void announce_epoch();

    /// Those records that are more complete than what is known here.
    ise::result<std::vector<command_record>> news_among(const std::vector<command_record>& records);
    /// What is on disk already.
    void know(const std::vector<command_record>& news);
    /// Keeps the news among records of a damaged store; false while the disk fails.
    bool restore(const std::vector<command_record>& records);
    void begin_anew(); ///< the store is a new one

    std::size_t open_count() const noexcept { return router_.open_count(); }

    // Services.
    /// `verified`: the identity of `who`; empty: not verified.
    ise::task<telecommand_reply> command(telecommand_request request, std::string who, std::string verified,
                                         ise::time_point deadline);
    /// The same for raw ones, which `command` refuses.
    ise::task<telecommand_reply> raw_command(telecommand_request request, std::string who, std::string verified,
                                             ise::time_point deadline);
    ise::task<record_page> record(record_request request);
    /// Only by the operator who gave it, or who has the authority; at either node.
    ise::task<recall_reply> call_back(recall_request request, std::string who);

private:
    ise::task<ise::result<std::optional<command_record>>> recorded(std::uint32_t id);
    ise::task<telecommand_reply> accept(telecommand_request request, std::string who, std::string verified,
                                        ise::time_point deadline);
    void check(const telecommand_request& request, const std::string& who);
    /// It is on record then, and under way; one that another node has recorded under its id is given back.
    ise::task<ise::result<command_record>> begin(telecommand_request request, std::string who, std::string verified);
    ise::task<> announce();
    void record_changes();
    void save();
    ise::task<> drive(command_router::give what);
    ise::task<recall_reply> call_back_at(std::string node, std::uint32_t id, std::string why);
    ise::task<> recall(command_router::recall what);
    ise::task<std::optional<recall_reply>> recall_from(link_id link, std::uint32_t id, std::string why);
    void on_recalled(link_id link, std::uint32_t id, telecommand_stage state, const std::string& text);

    node_context& here_;
    store_keeper& store_;
    other_node& peer_;
    boat_links& links_;
    node_authority& authority_;
    command_router router_;
    telecommand_audience audience_;
    ise::timer due_;
    std::map<std::uint32_t, ise::trace_id> traces_;   // of the calls that asked for the open ones
    std::map<std::uint32_t, command_record> unsaved_; // changes that the disk did not take
    std::map<std::uint32_t, command_record> saving_;  // of these, under way to it
    bool working_ = false;
};

} // namespace atirma
