#pragma once
/// Packets and cereal: every packet on every cereal archive (JSON, XML, binary), and ISE's wire archive as a pair of
/// cereal archives, `ise::output_archive` and `ise::input_archive`. Required before the use of packets that have a
/// `serialize` of their own. cereal's archives trust their input: from untrusted peers decode ISE's bytes or
/// `from_json`.
#include <ise/packet/detail/by_cereal.hpp>
#include <ise/packet/detail/cereal_archives.hpp>
#include <ise/packet/detail/cereal_packets.hpp>
