#include <ise/instantiation/instantiation_server.hpp>

#include <ise/service/service_host.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace ise::instantiation {

std::string path_of_host(std::string_view host_name) {
    std::string name;
    for (unsigned char letter : host_name.substr(0, 100)) {
        char one = static_cast<char>(letter);
        name += one != '/' && naming::is_path(std::string_view(&one, 1)) ? one : '-';
    }
    return fmt::format("{}/{}", hosts_path, name.empty() ? "unnamed" : name);
}

result<void> may_listen(const endpoint& at, const security& credentials) {
    auto demanding = credentials;
    demanding.demanded = true;
    auto may = demanding.may_listen(at);
    if (may) return {};
    return failure(
        may.error().code(),
        fmt::format("an instantiation server could be told by anybody to start programs: {}", may.error().message()));
}

instantiation_server::instantiation_server(machine& host, server_options options)
    : host_(host), options_(std::move(options)) {
    announce_when_ready();
}
instantiation_server::~instantiation_server() = default;

task<> instantiation_server::run() {
    for (const auto& at : this->services().listening()) may_listen(at, this->services().peers().credentials()).value();
    names_ = at(options_.name_server, std::string(naming::server_path));
    offer_services();
    offer_watching();
    co_await read_catalogue();
    for (const auto& problem : catalogue_->problems()) log().warning(problem);
    std::string problem;
    auto before = load_state(host_, state_file(), problem);
    if (!problem.empty()) log().error(problem);
    restore(before);
    look_ = std::make_unique<timer>(on(), [this] { look_at_output(); });
    look_at_output();
    struct ending { // nothing is decided any more, whatever ends from now on
        instantiation_server& self;
        ~ending() {
            self.stopping_ = true;
            self.look_->disarm();
            for (const auto& [path, one] : self.instances_) {
                one->due->disarm();
                one->running.reset();
            }
            for (const auto& [name, process] : self.processes_) process->running.reset();
        }
    } guard{*this};
    co_await ready();
    co_await sleep_till(time_point::max());
}

void instantiation_server::offer_services() {
    provide(services::types, [this](types_request) { return tell_types(); });
    provide(services::start, [this](start_request request) { return start_one(std::move(request)); });
    provide(services::restart, [this](restart_request request) { return restart_one(std::move(request.path)); });
    provide(services::stop, [this](stop_request request) { return end_one(std::move(request), false); });
    provide(services::kill, [this](kill_request request) {
        stop_request at_once;
        at_once.path = std::move(request.path);
        return end_one(std::move(at_once), true);
    });
    provide(services::set, [this](set_request request) { return set(std::move(request)); });
    provide(services::change, [this](change_request request) { return change_one(std::move(request)); });
    provide(services::check, [this](checks_request request) { return check_all(std::move(request)); });
    provide(services::instances, [this](instances_request request) {
        instances_response made;
        for (const auto& [path, one] : instances_)
            if (naming::lies_below(path, request.prefix)) made.instances.push_back(text_of(*one));
        return made;
    });
    provide(services::last_output, [this](output_request request) {
        auto one = find(request.path);
        constexpr std::uint32_t most = 1 << 20;
        auto piece = one->output->last(std::min(request.max_bytes, most));
        piece.path = request.path;
        return piece;
    });
}

void instantiation_server::offer_watching() {
    publication_callbacks<std::remove_const_t<decltype(services::output)>> callbacks;
    callbacks.on_subscribe = [this](const follow_request& request, const subscriber_info& who) -> result<nothing> {
        if (!instances_.contains(request.path))
            return failure(errc::refused,
                           fmt::format("no instance '{}' was started here", request.path.substr(0, 200)));
        followers_[who.number] = request.path;
        return nothing();
    };
    callbacks.on_unsubscribe = [this](const nothing&, const subscriber_info& who) {
        followers_.erase(who.number);
        return nothing();
    };
    output_ = publish(services::output, std::move(callbacks));
    events_ = publish(services::events);
}

instance_info instantiation_server::text_of(const instance& one) const {
    auto made = one.text();
    if (!one.running || one.version.empty() || one.plan.program.empty()) return made;
    auto now = host_.version_of(options_.programs_folder + "/" + one.plan.program);
    made.rebuilt = !now.empty() && now != one.version;
    return made;
}

instantiation_server::instance_ptr instantiation_server::find(const std::string& path) const {
    auto found = instances_.find(path);
    if (found != instances_.end()) return found->second;
    std::vector<std::string> known;
    for (const auto& [name, one] : instances_) known.push_back(name);
    throw error(errc::refused, fmt::format("no instance '{}' was started here; there {}", path.substr(0, 200),
                                           known.empty() ? "are none" : fmt::format("are {}", fmt::join(known, ", "))));
}

std::shared_ptr<output_file> instantiation_server::output_of(const std::string& path,
                                                             const std::string& process) const {
    std::string name = process.empty() ? "" : "+process+" + process; // no path has a plus
    if (process.empty())
        for (char letter : path) name += letter == '/' ? '+' : letter;
    for (const auto& [other, one] : instances_)
        if (!process.empty() && one->asked.process == process) return one->output;
    return std::make_shared<output_file>(host_, options_.state_folder + "/" + name + ".log", options_.max_output_bytes);
}

bool instantiation_server::prints_alone(const instance& one) const {
    return one.asked.process.empty() || (!process_of(one) && std::ranges::none_of(instances_, [&](const auto& other) {
               return other.second.get() != &one && other.second->output == one.output;
           }));
}

instantiation_server::instance_ptr instantiation_server::remember(start_request request, launch_plan plan) {
    auto path = plan.path;
    auto output = output_of(path, request.process);
    auto made = std::make_shared<instance>(env(), std::move(request), std::move(plan), std::move(output));
    made->since = wall();
    made->due = std::make_unique<timer>(on(), [this, weak = std::weak_ptr<instance>(made)] {
        if (auto one = weak.lock()) carry_out(one, one->watch.tick(now()));
    });
    instances_[path] = made;
    return made;
}

void instantiation_server::carry_out(const instance_ptr& one, supervision::act what) {
    switch (what) {
        case supervision::act::nothing: break;
        case supervision::act::launch:
            ++one->life;
            spawn("launch " + one->plan.path, launch(one, one->life));
            break;
        case supervision::act::terminate:
            if (one->running) one->running->terminate();
            break;
        case supervision::act::kill:
            if (one->running) one->running->kill();
            break;
    }
    changed(one);
}

void instantiation_server::changed(const instance_ptr& one) {
    auto next = one->watch.next();
    if (next == time_point::max()) one->due->disarm();
    else one->due->arm(next);
    for (auto* waiting : one->awaiting) waiting->resume();
    begin_probing(one);
    if (!one->asked.process.empty()) tend_processes();
    auto& last = told_[one->plan.path];
    if (last == std::pair(one->watch.state(), one->watch.reason())) return;
    if (last.first != one->watch.state()) one->since = wall();
    last = {one->watch.state(), one->watch.reason()};
    save();
    host_event event;
    event.at = wall();
    event.instance = one->text();
    events_(event);
    auto level = one->watch.state() == instance_state::failed || one->watch.state() == instance_state::waiting
                     ? log_level::warning
                     : log_level::info;
    static constexpr std::string_view names[] = {"starting", "ready", "stopping", "waiting to be started again",
                                                 "stopped",  "failed"};
    const auto& reason = one->watch.reason();
    log().write(level,
                fmt::format("{} is {}{}{}", one->plan.path, names[static_cast<std::size_t>(one->watch.state())],
                            reason.empty() ? "" : ": ", reason),
                {});
}

machine::end_handler instantiation_server::end_handler_of(const instance_ptr& one, const std::string& mark,
                                                          std::uint64_t life) {
    return [this, weak = std::weak_ptr<instance>(one), mark, life](process_end how) {
        free_names_of(mark);
        if (auto held = weak.lock()) on_end(held, life, how);
    };
}

/// A process has died: its names need not wait for the end of its lease.
void instantiation_server::free_names_of(const std::string& mark) {
    if (stopping_ || mark.empty()) return;
    freeing_.insert(mark);
    spawn("names of the dead", tell_end(mark));
}

task<> instantiation_server::tell_end(std::string mark) {
    naming::ended_request request;
    request.launch_mark = mark;
    auto told = co_await names_.try_call(naming::ended, std::move(request), std::chrono::seconds(2));
    freeing_.erase(freeing_.find(mark));
    if (!told)
        log().debug(
            fmt::format("names of a process that ended are free when its lease is over: {}", told.error().message()));
}

void instantiation_server::on_end(const instance_ptr& one, std::uint64_t life, process_end how) {
    if (life != one->life) return;
    if (one->running) how = how_it_ended(std::move(how), one->mark, *one->output);
    one->running.reset();
    carry_out(one, one->watch.ended(now(), how.well(), how.text()));
}

task<ended_response> instantiation_server::end_one(stop_request how, bool at_once) {
    auto one = find(how.path);
    auto patience = std::clamp(how.grace.value_or(one->asked.terms.grace), duration{}, duration(std::chrono::hours(1)));
    carry_out(one, at_once ? one->watch.kill(now()) : one->watch.stop(now(), patience));
    while (one->watch.state() == instance_state::stopping) co_await next_change(on(), one);
    ended_response made;
    for (auto where = process_of(*one); where && where->ending; where = process_of(*one))
        co_await sleep(std::chrono::milliseconds(10));
    made.ended = one->text();
    auto here = instances_.find(how.path);
    if (how.forget && one->watch.over() && here != instances_.end() && here->second == one) forget(how.path);
    co_return made;
}

void instantiation_server::look_at_output() {
    std::map<output_file*, std::set<std::string>> files; // several paths may share one
    for (const auto& [path, one] : instances_) files[one->output.get()].insert(path);
    for (auto& [file, paths] : files) {
        std::set<std::string> followed;
        for (const auto& [number, path] : followers_)
            if (paths.contains(path)) followed.insert(path);
        auto piece = file->look(!followed.empty());
        if (piece.text.empty()) continue;
        for (const auto& path : followed) {
            piece.path = path;
            output_.to_some(piece, [&](const subscriber_info& who) {
                auto found = followers_.find(who.number);
                return found != followers_.end() && found->second == path;
            });
        }
    }
    look_->arm(saturating_add(now(), options_.look_every));
}

} // namespace ise::instantiation
