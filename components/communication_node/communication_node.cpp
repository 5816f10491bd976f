#include <components/communication_node/communication_node.hpp>

#include <components/communication_node/replication.hpp>
#include <components/communication_node/store_repair.hpp>
#include <components/postgres/postgres.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr ise::duration housekeeping = 1s;

void check_options(const std::string& path, const communication_node_options& options) {
    auto refuse = [](const std::string& why) { throw ise::error(ise::errc::invalid_argument, why); };
    if (options.silence < 1s)
        refuse("a communication node gives the other one up after 1 s of silence at the earliest");
    if (!options.store.empty()) {
        if (!is_postgres_url(options.store))
            refuse("a store is named by postgresql://user@host/database; a file by its own option");
        if (auto good = check_postgres_url(options.store); !good) refuse(good.error().message());
        if (!options.peer.empty() || options.secondary)
            refuse("nodes that share a store on PostgreSQL have no peer and none is secondary: start as many as you "
                   "like with the same store");
    }
    if (!options.peer.empty() && options.peer == path)
        refuse(fmt::format("'{}' cannot back itself: name the other node as its peer", path));
    for (const auto& proxy : options.proxies)
        if (std::ranges::count(options.proxies, proxy.link, &proxy_of_link::link) > 1)
            refuse(fmt::format("two proxies for {}: each link has one", name_of(proxy.link)));
}

} // namespace

/// Each part knows those before it.
struct communication_node::parts {
    parts(node_context& context, opened_store& opened);
    void offer_services();
    void restore(const std::string& file);
    void tick();
    node_store::news news();
    void report(communication_state& into) const;

    node_context& here;
    store_keeper store;
    other_node peer;
    boat_links links;
    kept_telemetry telemetry;
    node_authority authority;
    node_telecommands telecommands;
    replication replicated;

private:
    store_keeper::actions store_actions();
    boat_links::actions link_actions();
};

communication_node::parts::parts(node_context& context, opened_store& opened)
    : here(context), store(here, opened, store_actions()), peer(here, [this] { tick(); }), links(here, link_actions()),
      telemetry(here, store, peer, links, opened, [this] { telecommands.work(); }),
      authority(here, store, peer, opened, [this] { telecommands.announce_epoch(); }),
      telecommands(here, store, peer, links, authority, opened),
      replicated(here, store, peer, telemetry, authority, telecommands) {}

void communication_node::parts::restore(const std::string& file) {
    here.self.spawn(fmt::format("reads {}", file),
                    restore_intact(file, here, store, telemetry, authority, telecommands));
}

store_keeper::actions communication_node::parts::store_actions() {
    store_keeper::actions made;
    made.changed = [this] { replicated.consider_serving(); };
    made.begun_anew = [this] { // what is known in memory goes to the new file at once
        telemetry.begin_anew();
        peer.forget();
        authority.begin_anew();
        telecommands.begin_anew();
        peer.notify_news();
        peer.notify_progress();
        replicated.consider_serving();
    };
    made.restore = [this](const std::string& file) { restore(file); };
    return made;
}

node_store::news communication_node::parts::news() {
    node_store::news made;
    made.packets = [this] { telemetry.show(); };
    made.commands = [this](const std::vector<command_record>& records) {
        telecommands.know(records);
        telecommands.work();
    };
    made.authority = [this](const node_store::change_of_authority& state) {
        if (authority.book().is_newer(state.first, state.second)) authority.set(state.first, state.second);
    };
    made.node_lost = [this](const std::string& node) {
        telecommands.take_over(node);
        telecommands.work();
    };
    made.went_back = [this] { telemetry.went_back(); };
    made.lost = [this](const ise::failure& why) { store.failed(why); };
    return made;
}

boat_links::actions communication_node::parts::link_actions() {
    boat_links::actions made;
    made.received = [this](std::vector<telemetry_packet> packets) { telemetry.receive(std::move(packets)); };
    made.status = [this](link_id link, const telecommand_status& status) { telecommands.on_status(link, status); };
    made.reached = [this] { telecommands.work(); };
    return made;
}

void communication_node::parts::offer_services() {
    auto& self = here.self;
    self.provide(services::telemetry_store,
                 [this](keep_request request) { return telemetry.keep(std::move(request)); });
    self.provide(services::track, [this](track_request request) { return telemetry.track(request); });
    self.provide(services::telecommand, [this](telecommand_request request, const ise::call_context& context) {
        return telecommands.command(std::move(request), operator_of(context.caller, context.who),
                                    std::string(context.who), context.deadline);
    });
    self.provide(services::raw_telecommand, [this](telecommand_request request, const ise::call_context& context) {
        return telecommands.raw_command(std::move(request), operator_of(context.caller, context.who),
                                        std::string(context.who), context.deadline);
    });
    self.provide(services::telecommand_recall, [this](recall_request request, const ise::call_context& context) {
        return telecommands.call_back(std::move(request), operator_of(context.caller, context.who));
    });
    self.provide(services::authority, [this](authority_request request, const ise::call_context& context) {
        return authority.change(std::move(request), operator_of(context.caller, context.who));
    });
    self.provide(services::telecommand_record, [this](record_request request) { return telecommands.record(request); });
    self.provide(services::replication,
                 [this](replication_request request) { return replicated.tell(std::move(request)); });
}

void communication_node::parts::tick() {
    links.look();
    if (here.options.store.empty() && peer.silent()) telecommands.take_over();
    peer.watch_silence();
    store.tend();
    telemetry.take_held();
    telemetry.show();
    telecommands.work();
    replicated.consider_serving();
}

void communication_node::parts::report(communication_state& into) const {
    store.report(into);
    telemetry.report(into);
    links.report(into);
    replicated.report(into);
    into.telecommands_open = telecommands.open_count();
    into.authority = authority.now();
}

communication_node::communication_node(communication_node_options options)
    : options_(std::move(options)), here_{*this, options_} {
    announce_when_ready();
}
communication_node::~communication_node() = default;

ise::task<> communication_node::run() {
    check_options(path(), options_);
    parts_.reset(); // of a run before this one
    auto opened = co_await open_store(here_);
    parts_ = std::make_unique<parts>(here_, *opened);
    auto& all = *parts_;
    log().info("its store is open", {{options_.store.empty() ? "file" : "database", all.store->name()},
                                     {"packets", std::to_string(all.store->head())},
                                     {"telecommands open", std::to_string(all.telecommands.open_count())}});
    all.offer_services();
    all.store->follow(all.news());
    auto state = publish(services::communication);
    for (const auto& file : opened->aside) all.restore(file);
    opened.reset();
    co_await ready();
    all.links.start();
    all.replicated.start();
    for (auto next_state = now();;) {
        all.tick();
        if (now() >= next_state) {
            next_state = now() + options_.state_period;
            state(how());
        }
        co_await sleep(housekeeping);
    }
}

communication_state communication_node::how() const {
    communication_state made;
    made.node = path();
    made.secondary = options_.secondary;
    made.peer = options_.peer;
    if (parts_) parts_->report(made);
    return made;
}

} // namespace atirma
