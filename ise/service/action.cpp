#include <ise/service/action.hpp>

#include <ise/packet/type.hpp>

#include <algorithm>

namespace ise {

action_options action_options::replacing() {
    action_options made;
    made.concurrent = 1;
    made.busy = when_busy::replace;
    return made;
}

action_options action_options::queueing() {
    action_options made;
    made.concurrent = 1;
    made.busy = when_busy::queue;
    return made;
}

action_options action_options::exclusive() {
    action_options made;
    made.concurrent = 1;
    return made;
}

namespace {

struct no_goal {};

bool same_shape(const type_description& a, const type_description& b) {
    if (a.kind != b.kind || a.members.size() != b.members.size() || a.length != b.length) return false;
    return std::equal(a.members.begin(), a.members.end(), b.members.begin(),
                      [](const auto& x, const auto& y) { return x.name == y.name && same_shape(x.type, y.type); });
}

} // namespace

bool is_action(const packet_types& types) noexcept {
    if (types.kind != service_kind::subscription) return false;
    const auto& asked = types.schemas[role::subscribe_request].type();
    const auto& result = types.schemas[role::published].type();
    const auto& usual = schema_of<action_goal<no_goal>>().type();
    if (asked.name != usual.name || asked.members.size() != usual.members.size()) return false;
    if (result.name != "action_update" || result.members.size() != 1) return false;
    for (std::size_t place = 0; place + 1 < usual.members.size(); ++place)
        if (asked.members[place].name != usual.members[place].name ||
            !same_shape(asked.members[place].type, usual.members[place].type))
            return false;
    const auto& what = result.members[0].type;
    return what.kind == type_kind::variant && what.members.size() == 3 &&
           same_shape(what.members[2].type, schema_of<run_failure>().type());
}

action_schemas schemas_of_action(const packet_types& types) {
    const auto& what = types.schemas[role::published].type().members[0].type;
    return {schema(types.schemas[role::subscribe_request].type().members.back().type), schema(what.members[0].type),
            schema(what.members[1].type)};
}

} // namespace ise
