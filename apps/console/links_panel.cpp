#include "links_panel.hpp"

#include "choice_box.hpp"
#include "theme.hpp"

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <QAbstractItemView>
#include <QComboBox>
#include <QGridLayout>
#include <QLabel>
#include <QProgressBar>
#include <QScrollArea>

#include <algorithm>

namespace atirma::console {
namespace {

// The module's data sheet (components/xbee/at_command.cpp has the same table).
constexpr const char* powers[] = {"0 · 1 mW", "1 · 23 mW", "2 · 100 mW", "3 · 158 mW", "4 · 316 mW"};

QLabel* small(const QString& words, QWidget* parent) {
    auto* made = new QLabel(words, parent);
    made->setProperty("role", "small");
    made->setFont(font_of(11));
    return made;
}

QString bytes_text(std::uint64_t bytes) {
    if (bytes < 10000) return QStringLiteral("%1 B").arg(bytes);
    return QStringLiteral("%1 kB").arg(static_cast<double>(bytes) / 1000, 0, 'f', 1);
}

} // namespace

link_card::link_card(std::string path, operator_actions& actions, QWidget* parent)
    : QFrame(parent),
      path_(std::move(path)),
      actions_(actions) {
    setObjectName("card");
    auto* column = new QVBoxLayout(this);
    column->setContentsMargins(11, 8, 11, 9);
    column->setSpacing(5);
    auto* top = new QHBoxLayout;
    head_ = new QLabel(this);
    head_->setFont(font_of(15, QFont::DemiBold));
    head_->setToolTip(text(path_));
    state_ = new QLabel(this);
    state_->setObjectName("link_state");
    state_->setAlignment(Qt::AlignRight | Qt::AlignVCenter);
    state_->setSizePolicy(QSizePolicy::Ignored, QSizePolicy::Preferred);
    top->addWidget(head_);
    top->addWidget(state_, 1);
    column->addLayout(top);
    grid_ = new QGridLayout;
    grid_->setHorizontalSpacing(8);
    grid_->setVerticalSpacing(3);
    column->addLayout(grid_);
    heard_ = field(tr("Boat heard"), tr("The last packet of the boat over this link"));
    rssi_ = field(tr("Signal"), tr("Here / at the boat: strength of the last packet"));
    packets_ = field(tr("Packets"), tr("Telemetry over this link; in brackets what came over another before"));
    lost_ = field(tr("Lost, bad"), tr("Not received here though published; damaged"));
    queue_ =
        field(tr("Boat's queue"), tr("Waiting at the boat for this link; in brackets never sent since it was full"));
    commands_ = field(tr("Commands open"), tr("Not answered by the boat yet"));
    traffic_ =
        field(tr("Traffic"), tr("Bytes heard; of Iridium the credits that it cost, one for each 50 bytes begun"));
    boat_side_ = field(tr("Boat sent, failed"), tr("As the boat counts it"));
    modem_ = new QWidget(this);
    auto* grid = new QGridLayout(modem_);
    grid->setContentsMargins(0, 4, 0, 0);
    grid->setHorizontalSpacing(8);
    grid->setVerticalSpacing(4);
    power_ = new choice_box(modem_);
    power_->setObjectName("power of " + text(path_));
    power_->setToolTip(tr("Transmit power of the modem on shore"));
    for (const char* name : powers) power_->addItem(name);
    connect(power_, &QComboBox::activated, this, [this](int level) {
        set_xbee_parameter set;
        set.path = path_;
        set.name = "power_level";
        set.value = static_cast<std::uint64_t>(level);
        actions_.act(std::move(set));
    });
    duty_ = new QProgressBar(modem_);
    duty_->setRange(0, 100);
    duty_->setTextVisible(false);
    duty_->setToolTip(tr("Used part of the allowed duty cycle, over the last hour; at 100 % the modem falls silent"));
    temperature_ = new QLabel(modem_);
    failed_ = new QLabel(modem_);
    retries_ = new QLabel(modem_);
    answer_ = small({}, modem_);
    answer_->setWordWrap(true);
    grid->addWidget(small(tr("Power"), modem_), 0, 0);
    grid->addWidget(power_, 0, 1);
    grid->addWidget(small(tr("Duty cycle"), modem_), 0, 2);
    grid->addWidget(duty_, 0, 3);
    grid->addWidget(small(tr("Failed"), modem_), 1, 0);
    grid->addWidget(failed_, 1, 1);
    grid->addWidget(small(tr("Modem"), modem_), 1, 2);
    grid->addWidget(temperature_, 1, 3);
    grid->addWidget(small(tr("Retries"), modem_), 2, 0);
    grid->addWidget(retries_, 2, 1);
    grid->addWidget(answer_, 2, 2, 1, 2);
    grid->setColumnStretch(1, 1);
    grid->setColumnStretch(3, 1);
    failed_->setToolTip(tr("Transmissions that exhausted their retries"));
    retries_->setToolTip(tr("Acknowledgements that did not come; each cost a retry"));
    column->addWidget(modem_);
    modem_->hide();
}

QLabel* link_card::field(const QString& name, const QString& tip) {
    auto* label = small(name, this);
    auto* value = new QLabel(this);
    label->setToolTip(tip);
    value->setToolTip(tip);
    int row = fields_ / 2, column = fields_ % 2 * 2;
    grid_->addWidget(label, row, column);
    grid_->addWidget(value, row, column + 1);
    grid_->setColumnStretch(column + 1, 1);
    ++fields_;
    return value;
}

void link_card::show_link(const link_view& link, const boat_view& boat, utc_time now) {
    const auto& t = colours();
    head_->setText(QStringLiteral("<span style='color:%1'>▬</span> %2")
                       .arg((link.link ? t.of(*link.link) : t.link_other).name(), text(label(link)).toHtmlEscaped()));
    auto trouble = !link.trouble.empty() ? link.trouble
                   : link.xbee           ? link.xbee->trouble
                   : link.account        ? link.account->trouble
                                         : std::string();
    auto how = freshness::none;
    if (link.last_heard)
        how = judge(age_s(now, *link.last_heard),
                    expected_period_s(value_kind::position, link.link.value_or(link_id::xbee), boat.settings));
    auto colour = !link.connected || !trouble.empty() ? t.bad : t.of(how);
    auto words = !link.connected           ? tr("not reached: %1").arg(text(trouble))
                 : !trouble.empty()        ? text(trouble)
                 : how == freshness::none  ? tr("boat not heard yet")
                 : how == freshness::fresh ? tr("live")
                                           : tr("silent");
    auto shown = QFontMetrics(state_->font()).elidedText(words, Qt::ElideRight, std::max(120, state_->width() - 18));
    state_->setText(QStringLiteral("<span style='color:%1'>● %2</span>").arg(colour.name(), shown.toHtmlEscaped()));
    state_->setToolTip(words);
    heard_->setText(link.last_heard ? QStringLiteral("<span style='color:%1'>%2</span>")
                                          .arg(t.of(how).name(), text(age_text(age_s(now, *link.last_heard))))
                                    : "–");
    std::optional<heard<link_status>> there;
    if (link.link && static_cast<std::size_t>(*link.link) < link_count)
        there = boat.links[static_cast<std::size_t>(*link.link)];
    auto dbm = [](int value) {
        return value ? QStringLiteral("%1").arg(value).replace('-', QChar(0x2212)) : QStringLiteral("–");
    };
    rssi_->setText(
        QStringLiteral("%1 / %2 dBm")
            .arg(dbm(link.xbee ? link.xbee->rssi_dbm.value_or(0) : 0), dbm(there ? there->value.rssi_dbm : 0)));
    packets_->setText(QStringLiteral("%1 (%2)").arg(link.packets).arg(link.duplicates));
    lost_->setText(QStringLiteral("%1, %2").arg(link.lost).arg(link.malformed));
    queue_->setText(there ? QStringLiteral("%1 (%2)").arg(there->value.queued).arg(there->value.dropped) : "–");
    auto cost = link.credits ? tr(" · %1 credits").arg(link.credits) : QString();
    if (link.account) {
        const auto& a = *link.account;
        cost = tr(" · %1 credits").arg(a.today.mo_credits + a.today.mt_credits);
        traffic_->setToolTip(tr("Credits: today %1 from the boat and %2 to it, this month %3; budget for telecommands "
                                "today: %4")
                                 .arg(a.today.mo_credits)
                                 .arg(a.today.mt_credits)
                                 .arg(a.this_month.mo_credits + a.this_month.mt_credits)
                                 .arg(a.daily_budget ? QString::number(*a.daily_budget) : tr("no limit")));
    }
    traffic_->setText(bytes_text(link.bytes) + cost);
    boat_side_->setText(there ? QStringLiteral("%1, %2").arg(there->value.sent).arg(there->value.failed) : "–");
    commands_->setText(QString::number(link.open_commands));
    modem_->setVisible(link.xbee.has_value());
    if (link.xbee) show_modem(link, now);
}

void link_card::show_modem(const link_view& link, utc_time now) {
    const auto& t = colours();
    const auto& modem = *link.xbee;
    bool old = link.xbee_at && age_s(now, *link.xbee_at) > 10;
    auto number = [&](auto value, const char* unit) {
        return value ? QStringLiteral("%1%2").arg(*value).arg(unit) : QStringLiteral("–");
    };
    if (!power_->view()->isVisible()) power_->setCurrentIndex(modem.power_level ? *modem.power_level : -1);
    power_->setEnabled(link.connected && modem.modem_ready);
    duty_->setValue(modem.duty_cycle_percent.value_or(0));
    auto warm = modem.temperature_c.value_or(0) >= 60;
    auto volts = modem.supply_mv ? QStringLiteral(" · %1 V").arg(*modem.supply_mv / 1000.0, 0, 'f', 2) : QString();
    temperature_->setText(QStringLiteral("<span style='color:%1'>%2</span>%3%4")
                              .arg((warm ? t.bad : t.ink).name(), number(modem.temperature_c, " °C"), volts,
                                   old ? tr(" · old") : QString()));
    failed_->setText(number(modem.failed_deliveries, ""));
    retries_->setText(number(modem.failed_acknowledgements, ""));
    answer_->setText(link.xbee_answer.empty()
                         ? tr("duty %1").arg(number(modem.duty_cycle_percent, " % of the hour's share"))
                         : text(link.xbee_answer));
}

links_panel::links_panel(operator_actions& actions, QWidget* parent) : QWidget(parent), actions_(actions) {
    auto* outer = new QVBoxLayout(this);
    outer->setContentsMargins(0, 2, 0, 0);
    auto* area = new QScrollArea(this);
    area->setWidgetResizable(true);
    area->setFrameShape(QFrame::NoFrame);
    area->setHorizontalScrollBarPolicy(Qt::ScrollBarAlwaysOff);
    auto* inside = new QWidget;
    column_ = new QVBoxLayout(inside);
    column_->setContentsMargins(0, 0, 2, 0);
    column_->setSpacing(6);
    empty_ = new QLabel(
        tr("No link to a boat is running yet. It is shown here as soon as its proxy registers with the name server."),
        inside);
    empty_->setWordWrap(true);
    empty_->setProperty("role", "small");
    column_->addWidget(empty_);
    column_->addStretch(1);
    area->setWidget(inside);
    outer->addWidget(area);
}

void links_panel::show_snapshot(const snapshot& seen, utc_time now) {
    empty_->setVisible(seen.links.empty() && seen.nodes.empty());
    for (const auto& node : seen.nodes) {
        auto& card = nodes_[node.path];
        if (!card) column_->insertWidget(column_->count() - 1, card = new node_card(node.path, this));
        card->show_node(node, now);
    }
    std::vector<const link_view*> links;
    for (const auto& link : seen.links)
        if (!link.all_links) links.push_back(&link);
    std::ranges::stable_sort(links, {}, [](const auto* of) { return of->link ? static_cast<int>(*of->link) : 100; });
    int place = 1; // below the words where there is none
    for (const auto* each : links) {
        const auto& link = *each;
        auto& card = cards_[link.path];
        if (!card) {
            card = new link_card(link.path, actions_, this);
            column_->insertWidget(place, card);
        }
        ++place;
        card->show_link(link, seen.boat, now);
    }
}

} // namespace atirma::console
