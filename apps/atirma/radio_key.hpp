#pragma once
#include <ise/component/component_type.hpp>

#include <string>

namespace atirma {

/// The parameters of a proxy by which its link is sealed.
inline void add_radio_key(ise::parameter_set& to, std::string& file, bool& secondary) {
    to.add(
          "radio-key", file,
          "file of the radio's key (atirma keys new): telecommands are sealed, and what is not of the boat is dropped; "
          "empty: not sealed")
        .kind(ise::parameter_kind::path);
    to.add("radio-secondary", secondary, "a second proxy of this link with the same key: it has counters of its own");
}

} // namespace atirma
