#include <components/boat/services.hpp>

namespace atirma {

telecommand to_telecommand(std::uint32_t id, utc_time sent_at, const boat_command& what) {
    telecommand made;
    made.id = id;
    made.kind = what.kind;
    made.sent_at = sent_at;
    made.mode = what.mode;
    made.index = what.index;
    made.point = what.point;
    made.parameter = what.parameter;
    made.value = what.value;
    made.link = what.link;
    made.period_s = what.period_s;
    made.on = what.on;
    return made;
}

} // namespace atirma
