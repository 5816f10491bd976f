#include <ise/core/listed_waiter.hpp>
#include <ise/instantiation/instance.hpp>

#include <map>

namespace ise::instantiation {

instance_info instance::text() const {
    instance_info made;
    made.path = plan.path;
    made.type = asked.type;
    made.program = plan.program;
    made.state = watch.state();
    made.reason = watch.reason();
    made.process_id = running ? running->stamp().pid : 0;
    made.since = since;
    made.restarts = watch.restarts();
    made.adopted = adopted;
    made.terms = asked.terms;
    made.arguments = asked.arguments;
    made.listen = asked.listen;
    made.protocol = asked.protocol;
    for (const auto& one : asked.variables) made.variables.push_back({one.name, {}});
    made.roles = asked.roles;
    made.deployment = asked.deployment;
    made.process = asked.process;
    made.limits = asked.limits;
    made.identity = asked.identity;
    made.user = asked.user;
    made.output_dropped = output->dropped();
    made.output_trouble = output->trouble();
    made.probe_trouble = probe_trouble;
    return made;
}

start_request instance::asked_again() const {
    auto made = asked;
    made.path = plan.path;
    made.name_space.clear();
    return made;
}

saved_instance instance::saved() const {
    saved_instance made;
    made.asked = asked;
    made.path = plan.path;
    made.mark = mark;
    if (running) made.process = running->stamp();
    made.state = watch.state();
    made.reason = watch.reason();
    made.since = since;
    made.restarts = watch.restarts();
    made.program_version = version;
    made.former = former;
    made.undo = undo;
    return made;
}

bool instance::other_environment(const start_request& wanted) const {
    auto by_name = [](const std::vector<argument>& all) {
        std::map<std::string, std::string> made;
        for (const auto& one : all) made[one.name] = one.value;
        return made;
    };
    return by_name(asked.variables) != by_name(wanted.variables);
}

process_end how_it_ended(process_end result, const std::string& mark, const output_file& printed) {
    if (result.known) return result;
    auto record = printed.status();
    bool of_it = record && record->ended && record->mark == mark;
    return of_it ? record->how : result;
}

task<> next_change(loop& on, std::shared_ptr<instance> of) {
    listed_waiter result(on, of->awaiting);
    co_await result.wait();
}

} // namespace ise::instantiation
