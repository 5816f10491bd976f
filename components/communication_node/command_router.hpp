#pragma once
#include <components/boat/telecommand_table.hpp>
#include <components/communication_node/link_table.hpp>
#include <components/communication_node/services.hpp>

#include <map>

namespace atirma {

struct desk_options {
    std::size_t max_open = 64;        ///< telecommands that are not decided (`check_place`); above: overloaded
    std::size_t max_remembered = 512; ///< decided ones in memory; older ones are on disk
};

/// The telecommands of the whole boat, without I/O: which one is given to which link when, to another link when the
/// first does not deliver, and what the links' answers mean for it. The boat executes an id once, so that the same one
/// may take several links. A link that has one goes on trying until its validity is over. Bounded.
///
///     auto id = desk.submit(now, wall, request, chosen, "ana", epoch, "atirma/shore/node-1");
///     for (auto& changed : desk.take_changes()) put it to disk, tell everybody
///     while (auto give = desk.next_give(now, wall, links)) give->request to the proxy of give->link
///     desk.on_status(wall, link, what the proxy says)
class command_router {
public:
    explicit command_router(desk_options options = desk_options())
        : options_(options), table_(options.max_remembered) {}

    /// Takes a telecommand; of an id that is known already, which must mean the same, nothing new. The record, to be
    /// put to disk. Errors: invalid_argument, overloaded.
    /// `over`: the link that it will take as things stand, for its validity if the request names none.
    ise::result<command_record> prepare(ise::time_point now, utc_time wall, const telecommand_request& request,
                                        std::uint32_t chosen, const std::string& asked_by, std::uint32_t authority,
                                        const std::string& node, link_id over = link_id::xbee) const;
    /// One that is on disk: prepared here, read at the start, or told by the other node. It is driven where
    /// `record.node` is `me`. True if it changed what was known.
    bool know(ise::time_point now, utc_time wall, const command_record& record, const std::string& me);
    /// The open ones of another node, or of any other if `from` is empty, become ours; `take_changes` has those that
    /// changed.
    void take_over(ise::time_point now, utc_time wall, const std::string& me, const std::string& from = {});

    struct give {
        std::uint32_t id = 0;
        link_id link = link_id::xbee;
        telecommand_request request; ///< with what is left of its validity
        bool only_recall = false;    ///< it is called back, and this link may have it since before this node had it
    };
    /// One that is to be given to a link now; it counts as given until it is decided.
    std::optional<give> next_give(ise::time_point now, utc_time wall, const link_table& links);
    /// What the proxy of a link says of it.
    void on_status(utc_time wall, link_id link, const telecommand_status& status);
    /// The proxy does not accept it: another link gets it at once, and this one again after 30 s. It fails if the link
    /// was chosen.
    void on_refused(ise::time_point now, utc_time wall, std::uint32_t id, link_id link, const std::string& why);
    /// The proxy of that link has it, or may have it.
    void on_given(std::uint32_t id, link_id link);
    /// It is called back: no further link gets it, and those that have it are to be asked (`services::
    /// telecommand_recall`); what they tell comes to `on_status`. One that no link has is decided at once.
    std::vector<link_id> call_back(utc_time wall, std::uint32_t id, const std::string& why);
    void on_time(ise::time_point now, utc_time wall);
    /// When `on_time` and `next_give` may have something to do.
    ise::time_point next_event(ise::time_point now, const link_table& links) const;

    const command_record* find(std::uint32_t id) const;
    bool is_called_back(std::uint32_t id) const;
    std::vector<telecommand_status> open() const;
    std::size_t open_count() const noexcept { return table_.open().size(); }
    struct recall {
        std::uint32_t id = 0;
        link_id link = link_id::xbee; ///< that still has it
        std::string why;
    };
    /// Those that the boat has answered over one link since the last call, while others were still to send them; and
    /// those that a newer one replaces.
    std::vector<recall> take_recalls() { return std::exchange(recalls_, {}); }
    struct boat_epoch {
        std::uint32_t sent_under = 0; ///< the epoch of the telecommand that the boat answered
        std::uint32_t obeyed = 0;     ///< the epoch that the boat obeys
    };
    /// The epochs that the boat's answers told since the last call.
    std::vector<boat_epoch> take_boat_epochs() { return std::exchange(boat_epochs_, {}); }
    std::vector<command_record> take_changes() { return std::exchange(changes_, {}); }

private:
    struct at_link {
        bool given = false; // by this node; else another one did, and a status came
        ise::time_point since{};
        bool refused = false;
        ise::time_point retry_at = ise::time_point::max(); // after a refusal, whose cause may pass
        std::uint32_t attempts = 0;
        telecommand_stage stage = telecommand_stage::queued;
        bool may_be_there = false; // the proxy has it, as far as is known
        /// Its proxy may have sent it, and has not told how it ended.
        bool is_in_the_dark() const noexcept { return may_be_there && !refused && !is_final(stage); }
        bool to_be_asked() const noexcept { return may_be_there && !given && !refused; }
    };
    struct entry {
        command_record record;
        ise::time_point expires{};
        bool mine = false;
        std::map<link_id, at_link> links;
    };
    static void note_link(entry& e);
    static give give_to(entry& e, link_id link, ise::time_point now);
    void refused(entry& e, utc_time wall, link_id link, std::string text);
    void replace(utc_time wall, std::uint32_t id, std::uint32_t by);
    void end_called_back(entry& e, utc_time wall);
    void change(entry& e, utc_time wall, telecommand_stage stage, std::string text);
    static ise::duration left_of(ise::time_point now, utc_time wall, const command_record& record, bool mine);
    std::optional<ise::time_point> next_link_at(const entry& e, const link_table& links) const;

    desk_options options_;
    telecommand_table<entry> table_;
    std::vector<command_record> changes_;
    std::vector<recall> recalls_;
    std::vector<boat_epoch> boat_epochs_;
};

/// Of two records of one telecommand the one that knows more: an answer of the boat before any other end, an end before
/// none, then the later. Both nodes come to the same.
bool knows_more(const command_record& a, const command_record& b) noexcept;

} // namespace atirma
