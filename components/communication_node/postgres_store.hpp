#pragma once
#include <components/communication_node/node_store.hpp>
#include <components/communication_node/store_lives.hpp>
#include <components/postgres/postgres.hpp>

#include <ise/core/time.hpp>

#include <map>

namespace atirma {

struct postgres_store_options {
    std::string url;                                 ///< has passed check_postgres_url
    std::string boat;                                ///< whose rows are used; others are not seen
    std::string node;                                ///< path of this node, which other nodes see
    ise::duration silence = std::chrono::seconds(3); ///< after which another node counts as lost
};

/// The store of all communication nodes of a boat in a database of PostgreSQL, whose tables
/// `components/communication_node/postgres_schema.hpp` describes. Each call is one transaction, which locks the row of
/// the boat: positions are in the order of the commits, and two nodes never change the authority at once. What other
/// nodes do is looked for twice a second, by a statement that says as well that this node is alive.
///
/// The life of the store changes where the database is another one or went back in time: another system identifier, or
/// another timeline of PostgreSQL (a fail-over, a backup that was restored).
class postgres_store final : public node_store {
public:
    postgres_store(ise::loop& on, postgres_store_options options);
    ~postgres_store() override;

    /// Connects, and reads what a node continues with. Errors: io_failed (also for a database without the schema, or
    /// with an older one); invalid_argument for one of a newer program. Cancellation: terminal.
    ise::task<ise::result<memory>> opened();

    std::uint64_t number() const noexcept override { return lives_.now.store; }
    std::uint64_t head() const noexcept override { return lives_.now.packets; }
    std::uint64_t commands_head() const noexcept override { return lives_.now.commands; }
    std::string name() const override;

    void add(std::vector<telemetry_packet> packets, then<kept> done) override;
    void packets(std::uint64_t after, std::uint64_t up_to, std::size_t most,
                 then<std::vector<telemetry_packet>> done) override;
    void track(const track_request& request, std::uint64_t up_to, then<track_page> done) override;
    void begin(const command_record& record, std::uint32_t epoch, then<begun> done) override;
    void put(std::vector<command_record> records, then<void> done) override;
    void command(std::uint32_t id, then<std::optional<command_record>> done) override;
    bool is_shared_with(const std::string& node) const override { return others_.contains(node); }
    void list(const record_request& request, then<record_page> done) override;
    void put(const change_of_authority& state, const std::pair<std::uint32_t, std::uint64_t>& before,
             then<std::optional<change_of_authority>> done) override;
    void tend(std::uint64_t keep_packets, std::uint64_t keep_commands, then<std::int64_t> done) override;
    void follow(news follower) override { news_ = std::move(follower); }

private:
    /// `use` makes the value from the rows; what it throws, or the failure, is what `done` gets.
    template <class T, class Use>
    void ask(std::string_view sql, std::vector<postgres_value> bound, then<T> done, Use use);
    void greet();
    void greeted(const postgres_rows& rows);
    void remember();
    void fail(const ise::failure& why);
    void look();
    void looked(const postgres_rows& rows);
    void read_commands();
    void read_authority();
    void watch_nodes();
    std::vector<telemetry_packet> packets_in(const postgres_rows& rows, std::size_t from = 0) const;

    ise::loop& loop_;
    postgres_store_options options_;
    store_lives lives_;
    std::int64_t boat_ = 0; // its number in the database
    bool ready_ = false;    // the schema is the right one, and the boat is known
    std::uint64_t commands_read_ = 0;
    std::pair<std::uint32_t, std::uint64_t> authority_{};
    memory memory_;
    std::optional<ise::failure> refusal_; // of the database, until the next connection
    then<memory> on_opened_;
    news news_;
    struct other {
        std::string seen;
        ise::time_point at{};
        bool lost = false;
    };
    std::map<std::string, other> others_;
    bool looking_ = false, reading_commands_ = false;
    ise::timer look_;
    postgres_client client_; // the last: it calls back into the others
};

} // namespace atirma
