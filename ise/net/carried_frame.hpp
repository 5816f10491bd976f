#pragma once
#include <ise/core/passed_object.hpp>
#include <ise/wire/frame.hpp>

namespace ise::net {

/// A frame as a connection brings it, or gives it back unwritten. Valid during the call that it is passed to.
struct carried_frame : wire::frame {
    passed_object* object = nullptr; ///< the packet, where it came attached instead of at the body's end; may be taken
    /// Of a published packet: this frame and those that came behind it with the same type, flags and id, as they lie;
    /// empty where it did not lie among others.
    bytes_view run;
};

} // namespace ise::net
