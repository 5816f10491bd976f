// The parts of a node around its telecommands, over a store in memory.
#pragma once
#include <components/communication_node/node_telecommands.hpp>

#include <unit/name_server/system.hpp>

#include <support/catch.hpp>

namespace node_test {

using namespace atirma;
using namespace std::chrono_literals;

/// Keeps what it is given, as a shared database does; while `dies` the answers to changes are lost, while `away` all.
class dying_store final : public node_store {
public:
    bool dies = false, away = false;
    std::map<std::uint32_t, command_record> commands;
    change_of_authority holder;

    std::uint64_t number() const noexcept override { return 1; }
    std::uint64_t head() const noexcept override { return 0; }
    std::uint64_t commands_head() const noexcept override { return commands.size(); }
    std::string name() const override { return "database"; }
    void add(std::vector<telemetry_packet>, then<kept> done) override { answer(std::move(done), kept()); }
    void packets(std::uint64_t, std::uint64_t, std::size_t, then<std::vector<telemetry_packet>> done) override {
        answer(std::move(done), std::vector<telemetry_packet>());
    }
    void track(const track_request&, std::uint64_t, then<track_page> done) override {
        answer(std::move(done), track_page());
    }
    void begin(const command_record& record, std::uint32_t, then<begun> done) override {
        begun made;
        auto [at, fresh] = commands.emplace(record.status.id, record);
        if (!fresh) made.known = at->second;
        answer(std::move(done), made);
    }
    void put(std::vector<command_record> records, then<void> done) override {
        for (auto& record : records) commands[record.status.id] = record;
        done(dies ? ise::result<void>(lost()) : ise::result<void>());
    }
    void command(std::uint32_t id, then<std::optional<command_record>> done) override {
        auto found = commands.find(id);
        auto known = found == commands.end() ? std::nullopt : std::optional(found->second);
        done(away ? ise::result<std::optional<command_record>>(lost()) : std::move(known));
    }
    void list(const record_request&, then<record_page> done) override { answer(std::move(done), record_page()); }
    void put(const change_of_authority& state, const std::pair<std::uint32_t, std::uint64_t>&,
             then<std::optional<change_of_authority>> done) override {
        holder = state;
        answer(std::move(done), std::optional<change_of_authority>());
    }
    void tend(std::uint64_t, std::uint64_t, then<std::int64_t> done) override {
        answer(std::move(done), std::int64_t{0});
    }

private:
    static ise::failure lost() {
        return ise::failure(ise::errc::io_failed, "the connection was closed", ise::execution::unknown);
    }
    template <class T>
    void answer(then<T> done, T with) {
        done(dies ? ise::result<T>(lost()) : ise::result<T>(std::move(with)));
    }
};

inline boat_links::actions nothing_of_links() {
    boat_links::actions made;
    made.received = [](auto) {};
    made.status = [](auto, const auto&) {};
    made.reached = [] {};
    return made;
}

inline store_keeper::actions nothing_of_stores() {
    store_keeper::actions made;
    made.changed = made.begun_anew = [] {};
    made.restore = [](const std::string&) {};
    return made;
}

inline communication_node_options with_proxies() {
    communication_node_options made;
    made.proxies = {{link_id::xbee, "shore/xbee"}, {link_id::gprs, "shore/gprs"}, {link_id::iridium, "shore/iridium"}};
    return made;
}

/// The authority and the telecommands of a node.
struct desk {
    explicit desk(ise::component& self, std::unique_ptr<node_store> of = std::make_unique<dying_store>(),
                  communication_node_options with = with_proxies())
        : options(std::move(with)), here{self, options}, opened(std::move(of)),
          store(here, opened, nothing_of_stores()), peer(here, [] {}), links(here, nothing_of_links()),
          authority(here, store, peer, opened, [this] { ++announced; }),
          telecommands(here, store, peer, links, authority, opened) {}
    communication_node_options options;
    node_context here;
    opened_store opened;
    store_keeper store;
    other_node peer;
    boat_links links;
    int announced = 0;
    node_authority authority;
    node_telecommands telecommands;
};

/// Runs `body` as the only component of a process, to its end.
template <class Body>
void on_a_node(Body body) {
    ise::sim::world world;
    bool ended = false;
    world.host("shore").start_process("node", [&](ise::sim::process& env) {
        return names_test::lone_program(env, [&](ise::component& self) -> ise::task<> {
            auto running = body(self);
            co_await std::move(running);
            ended = true;
        });
    });
    REQUIRE(world.run_until([&] { return ended; }, 24h));
}

} // namespace node_test
