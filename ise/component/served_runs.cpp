#include <ise/component/served_runs.hpp>

#include <ise/component/served_calls.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/error.hpp>
#include <ise/core/loop.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/type.hpp>
#include <ise/service/action.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/service/run_tap.hpp>
#include <ise/service/service_host.hpp>
#include <ise/subscription/publication.hpp>

#include <fmt/format.h>

#include <memory>
#include <utility>

namespace ise {
namespace {

constexpr std::uint8_t parts = 4;

struct run_head {
    std::uint64_t run = 0;
    std::string requester;
};

type_member optional_member(std::string name, const type_description& type) {
    type_member inner, made;
    inner.type = type;
    made.name = std::move(name);
    made.type.kind = type_kind::optional;
    made.type.members.push_back(std::move(inner));
    made.type.complete();
    return made;
}

} // namespace

schema schema_of_runs(const dynamic_contract& action) {
    auto types = schemas_of_action(*action.types());
    auto made = schema_of<run_head>().type();
    made.name = "run_event";
    made.members.push_back(optional_member("goal", types.goal.type()));
    made.members.push_back(optional_member("feedback", types.feedback.type()));
    made.members.push_back(optional_member("result", types.result.type()));
    made.members.push_back(optional_member("failure", schema_of<run_failure>().type()));
    made.complete();
    return schema(std::move(made));
}

bytes encode_run(const served_run& what) {
    if (what.part >= parts) throw error(errc::malformed, fmt::format("a run has no part {}", what.part));
    run_head head;
    head.run = what.run;
    head.requester = what.requester;
    auto made = encode(head);
    for (std::uint8_t part = 0; part < parts; ++part) {
        made.push_back(static_cast<std::byte>(part == what.part ? 1 : 0));
        if (part == what.part) made.insert(made.end(), what.packet.begin(), what.packet.end());
    }
    return made;
}

void provide_served_runs(service_host& of) {
    if (!records_calls(of.env())) return;
    auto core = make_publication(of, served_runs_service);
    of.services().add(core).value();
    of.on().common<run_taps>().watch(of, [held = std::weak_ptr<publication_core>(core)](tapped_run run) {
        auto still = held.lock();
        if (!still || still->subscribers() == 0) return;
        served_run made;
        made.action = std::move(run.action);
        made.run = run.run;
        made.requester = std::move(run.requester);
        made.part = run.part;
        made.packet = std::move(run.packet);
        publication<std::remove_const_t<decltype(served_runs_service)>> out(still);
        out(made);
    });
}

} // namespace ise
