#pragma once
#include <ise/core/passed_object.hpp>
#include <ise/wire/frame.hpp>

namespace ise::net {

/// A frame as a connection brings it, or gives it back unwritten. Valid during the call that it is passed to.
struct carried_frame : wire::frame {
    passed_object* object = nullptr; ///< the packet, where it came attached instead of at the body's end; may be taken
    /// Of published packets: this frame and those that came behind it with the same type, flags and id, as they lie. Empty
    /// where it came alone.
    bytes_view run;
};

} // namespace ise::net
