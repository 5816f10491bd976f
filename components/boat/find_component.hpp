#pragma once
#include <ise/component/component.hpp>

#include <string>

namespace atirma {

/// The component that an option names: by its path ("atirma/shore/xbee"), or by an endpoint ("tcp://10.0.0.5:7411")
/// where there are no names. Throws ise::error (invalid_argument) for an endpoint that is none.
inline ise::remote find_component(ise::component& asker, const std::string& name) {
    if (name.find("://") == std::string::npos) return asker.at(name);
    return asker.at(ise::endpoint::parse(name).value());
}

} // namespace atirma
