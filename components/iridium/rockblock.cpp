#include <components/iridium/rockblock.hpp>

#include <components/iridium/text.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <array>
#include <vector>

namespace atirma::iridium {
namespace {

ise::failure bad_form(std::string what) { return ise::failure(ise::errc::malformed, std::move(what)); }

/// JSON's members as a form: strings as they are, numbers as they are written.
ise::result<form> members_of(std::string_view body) {
    auto read = nlohmann::json::parse(body, nullptr, false);
    if (read.is_discarded() || !read.is_object()) return bad_form("the body is not a JSON object");
    form fields;
    for (const auto& [name, value] : read.items()) {
        if (value.is_string()) fields[name] = value.get<std::string>();
        else if (value.is_number_float()) fields[name] = fmt::format("{}", value.get<double>());
        else if (value.is_number()) fields[name] = value.dump();
    }
    return fields;
}

const std::string* find(const form& in, std::string_view name) {
    auto found = in.find(name);
    return found == in.end() ? nullptr : &found->second;
}

ise::result<mo_delivery> delivery_of(const form& fields) {
    mo_delivery out;
    for (std::string_view name : {"imei", "momsn", "transmit_time", "data"})
        if (!find(fields, name)) return bad_form(fmt::format("the field {} is missing", name));
    out.message.imei = *find(fields, "imei");
    if (auto good = check_imei(out.message.imei); !good) return good.error();
    auto momsn = parse_integer("momsn", *find(fields, "momsn"), 0, 65535);
    if (!momsn) return momsn.error();
    out.message.momsn = static_cast<std::uint16_t>(*momsn);
    out.transmit_time = *find(fields, "transmit_time");
    auto time = parse_transmit_time(out.transmit_time);
    if (!time) return bad_form("transmit_time: " + time.error().message());
    out.message.session_time = *time;
    auto data = from_hex(*find(fields, "data"), max_mo_bytes);
    if (!data) return ise::failure(data.error().code(), "data: " + data.error().message());
    out.message.data = std::move(*data);
    if (const auto* serial = find(fields, "serial"); serial && !serial->empty()) {
        auto number = parse_integer("serial", *serial, 0, 0xFFFFFFFF);
        if (!number) return number.error();
        out.serial = static_cast<std::uint32_t>(*number);
    }
    const auto *latitude = find(fields, "iridium_latitude"), *longitude = find(fields, "iridium_longitude");
    if (latitude && longitude && !latitude->empty() && !longitude->empty()) {
        auto north = parse_real("iridium_latitude", *latitude, -90, 90);
        auto east = parse_real("iridium_longitude", *longitude, -180, 180);
        if (!north) return north.error();
        if (!east) return east.error();
        estimate where;
        where.latitude_deg = *north;
        where.longitude_deg = *east;
        if (const auto* radius = find(fields, "iridium_cep"); radius && !radius->empty()) {
            auto cep = parse_real("iridium_cep", *radius, 0, 20100);
            if (!cep) return cep.error();
            where.cep_km = *cep;
        }
        out.message.where = where;
    }
    if (const auto* type = find(fields, "device_type")) out.device_type = type->substr(0, 64);
    for (std::string_view name : {"JWT", "jwt"})
        if (const auto* token = find(fields, name); token && out.jwt.empty()) out.jwt = *token;
    return out;
}

} // namespace

ise::result<mo_delivery> parse_mo_delivery(std::string_view body) {
    auto first = body.find_first_not_of(" \t\r\n");
    bool json = first != std::string_view::npos && body[first] == '{';
    auto fields = json ? members_of(body) : parse_form(body);
    if (!fields) return fields.error();
    return delivery_of(*fields);
}

std::string encode_mo_form(const mo_delivery& what) {
    const auto& m = what.message;
    std::vector<std::pair<std::string, std::string>> fields;
    fields.emplace_back("imei", m.imei);
    fields.emplace_back("device_type", what.device_type);
    fields.emplace_back("serial", std::to_string(what.serial));
    fields.emplace_back("momsn", std::to_string(m.momsn));
    fields.emplace_back("transmit_time", format_transmit_time(m.session_time));
    if (m.where) {
        fields.emplace_back("iridium_latitude", fmt::format("{:.4f}", m.where->latitude_deg));
        fields.emplace_back("iridium_longitude", fmt::format("{:.4f}", m.where->longitude_deg));
        fields.emplace_back("iridium_cep", fmt::format("{:.1f}", m.where->cep_km));
    }
    fields.emplace_back("data", to_hex(m.data));
    if (!what.jwt.empty()) fields.emplace_back("JWT", what.jwt);
    return encode_form(fields);
}

std::string encode_mo_json(const mo_delivery& what) {
    const auto& m = what.message;
    nlohmann::json out;
    out["imei"] = m.imei;
    out["device_type"] = what.device_type;
    out["serial"] = what.serial;
    out["momsn"] = m.momsn;
    out["transmit_time"] = format_transmit_time(m.session_time);
    if (m.where) {
        out["iridium_latitude"] = m.where->latitude_deg;
        out["iridium_longitude"] = m.where->longitude_deg;
        out["iridium_cep"] = m.where->cep_km;
    }
    out["data"] = to_hex(m.data);
    if (!what.jwt.empty()) out["JWT"] = what.jwt;
    return out.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace);
}

std::string encode_mt_submission(const mt_submission& what) {
    std::vector<std::pair<std::string, std::string>> fields;
    fields.emplace_back("imei", what.imei);
    fields.emplace_back("username", what.username);
    fields.emplace_back("password", what.password);
    fields.emplace_back("data", what.data);
    if (what.flush) fields.emplace_back("flush", "yes");
    return encode_form(fields);
}

ise::result<mt_submission> parse_mt_submission(std::string_view body) {
    auto fields = parse_form(body);
    if (!fields) return fields.error();
    mt_submission out;
    auto take = [&](std::string_view name, std::string& into) {
        if (const auto* value = find(*fields, name)) into = *value;
    };
    take("imei", out.imei);
    take("username", out.username);
    take("password", out.password);
    take("data", out.data);
    const auto* flush = find(*fields, "flush");
    out.flush = flush && *flush == "yes";
    return out;
}

std::string_view explain_mt_failure(int code) noexcept {
    switch (static_cast<mt_failure>(code)) {
        case mt_failure::bad_login: return "the gateway refuses user name or password: check both";
        case mt_failure::no_such_imei: return "the gateway's account has no device of this IMEI: check the IMEI";
        case mt_failure::no_line_rental: return "the device has no line rental: pay it";
        case mt_failure::no_credit: return "the account has no credit left: buy some";
        case mt_failure::bad_hex: return "the gateway could not read the hex data";
        case mt_failure::too_long: return "the message is too long for the gateway";
        case mt_failure::no_data: return "the gateway saw no data in the message";
        case mt_failure::system_error: return "the gateway has trouble of its own";
    }
    return "the gateway failed in a way that its documentation does not name";
}

bool mt_failure_passes(int code) noexcept { return code < 10 || code > 16; }

ise::result<mt_reply> parse_mt_reply(std::string_view body) {
    while (!body.empty() && static_cast<unsigned char>(body.back()) <= ' ') body.remove_suffix(1);
    mt_reply out;
    auto comma = body.find(',');
    auto word = body.substr(0, comma);
    auto rest = comma == std::string_view::npos ? std::string_view() : body.substr(comma + 1);
    if (word == "OK") {
        out.accepted = true;
        out.reference = rest.substr(0, 64);
        return out;
    }
    if (word != "FAILED")
        return bad_form(fmt::format("the gateway answered neither OK nor FAILED: '{}'", body.substr(0, 60)));
    comma = rest.find(',');
    auto code = parse_integer("the code of a failure", rest.substr(0, comma), 0, 9999);
    if (!code) return code.error();
    out.code = static_cast<int>(*code);
    if (comma != std::string_view::npos) out.text = rest.substr(comma + 1, 200);
    return out;
}

std::string encode_mt_reply(const mt_reply& reply) {
    return reply.accepted ? "OK," + reply.reference : fmt::format("FAILED,{},{}", reply.code, reply.text);
}

} // namespace atirma::iridium
