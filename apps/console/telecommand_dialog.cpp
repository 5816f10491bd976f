#include "telecommand_dialog.hpp"

#include "number_box.hpp"
#include "theme.hpp"

#include <components/boat/raw_payload.hpp>
#include <components/gui_client/words.hpp>

#include <QCheckBox>
#include <QComboBox>
#include <QDialogButtonBox>
#include <QFormLayout>
#include <QLabel>
#include <QLineEdit>
#include <QPushButton>
#include <QSpinBox>

#include <limits>

namespace atirma::console {

telecommand_dialog::telecommand_dialog(const boat_command& preset, const QString& usual, QWidget* parent)
    : QDialog(parent), command_(preset), form_(new QFormLayout), trouble_(new QLabel(this)),
      valid_(new QSpinBox(this)) {
    setObjectName("telecommand");
    setWindowTitle(text(describe(preset.kind())));
    auto* column = new QVBoxLayout(this);
    column->addWidget(new QLabel(text(std::string(traits_of(preset.kind()).help)), this));
    form_->setHorizontalSpacing(18);
    form_->setVerticalSpacing(7);
    column->addLayout(form_);
    trouble_->setObjectName("telecommand_trouble");
    trouble_->setStyleSheet(QStringLiteral("color: %1").arg(colours().bad.name()));
    trouble_->setWordWrap(true);
    column->addWidget(trouble_);
    auto* buttons = new QDialogButtonBox(this);
    accept_ = buttons->addButton(tr("Send it"), QDialogButtonBox::AcceptRole);
    accept_->setObjectName("telecommand_accept");
    accept_->setProperty("role", "primary");
    buttons->addButton(tr("Cancel"), QDialogButtonBox::RejectRole);
    connect(buttons, &QDialogButtonBox::accepted, this, &QDialog::accept);
    connect(buttons, &QDialogButtonBox::rejected, this, &QDialog::reject);
    column->addWidget(buttons);
    command_.for_each_argument(
        [this](std::string_view name, auto& value) { add_editor(text(std::string(name)), value); });
    valid_->setObjectName("telecommand_valid");
    valid_->setRange(0, 86400);
    valid_->setSuffix(tr(" s"));
    valid_->setSpecialValueText(usual.isEmpty() ? tr("usual") : usual);
    valid_->setToolTip(tr("The boat executes it within this time, or never"));
    form_->addRow(tr("validity"), valid_);
    check_command();
}

std::optional<float> telecommand_dialog::valid_s() const {
    if (valid_->value() == 0) return std::nullopt;
    return static_cast<float>(valid_->value());
}

template <class T>
void telecommand_dialog::add_editor(const QString& name, T& value) {
    auto shown = QString(name).replace('_', ' ');
    auto add = [&](auto* box) {
        box->setObjectName("argument_" + name);
        form_->addRow(shown, box);
        return box;
    };
    if constexpr (std::is_same_v<T, bool>) {
        auto* box = add(new QCheckBox(this));
        box->setChecked(value);
        connect(box, &QCheckBox::toggled, this, [this, &value](bool on) {
            value = on;
            check_command();
        });
    } else if constexpr (std::is_enum_v<T>) {
        auto* box = add(new QComboBox(this));
        for (const auto& one : names_of<T>()) {
            box->addItem(text(std::string(one.name)).replace('_', ' '), static_cast<int>(one.value));
            if (one.value == value) box->setCurrentIndex(box->count() - 1);
        }
        connect(box, &QComboBox::currentIndexChanged, this, [this, box, &value] {
            value = static_cast<T>(box->currentData().toInt());
            check_command();
        });
    } else {
        constexpr bool whole = std::is_integral_v<T>;
        // Places in a list are shown starting with 1.
        double first =
            traits_of(command_.kind()).words.find((name + "+1").toStdString()) == std::string_view::npos ? 0 : 1;
        auto* box = add(new number_box(whole ? static_cast<double>(std::numeric_limits<T>::min()) + first : -1e9,
                                       whole ? static_cast<double>(std::numeric_limits<T>::max()) + first : 1e9, this));
        box->setDecimals(whole ? 0 : 3);
        box->setValue(static_cast<double>(value) + first);
        connect(box, &QDoubleSpinBox::valueChanged, this, [this, box, first, &value](double now) {
            if (box->good()) value = static_cast<T>(now - first); // else `check_command` says what is wrong
            check_command();
        });
        numbers_.emplace_back(shown, box);
    }
}

void telecommand_dialog::add_editor(const QString& name, waypoint& value) {
    auto add = [&](const QString& part, double limit, double& degrees) {
        auto* box = new number_box(-limit, limit, this);
        box->setObjectName("argument_" + name + "_" + part);
        box->setDecimals(7);
        box->setSuffix("°");
        box->setValue(degrees);
        connect(box, &QDoubleSpinBox::valueChanged, this, [this, box, &degrees](double now) {
            if (box->good()) degrees = now;
            check_command();
        });
        form_->addRow(part, box);
        numbers_.emplace_back(part, box);
    };
    add(tr("latitude"), 90, value.latitude_deg);
    add(tr("longitude"), 180, value.longitude_deg);
}

void telecommand_dialog::add_editor(const QString& name, std::string& value) {
    auto* box = new QLineEdit(text(value), this);
    box->setObjectName("argument_" + name);
    box->setPlaceholderText(tr("text, or hex:0A1B"));
    box->setMaxLength(static_cast<int>(4 + 3 * max_raw_bytes));
    connect(box, &QLineEdit::textChanged, this, [this, &value](const QString& now) {
        value = now.toStdString();
        check_command();
    });
    form_->addRow(name, box);
}

void telecommand_dialog::check_command() {
    auto good = atirma::check(command_);
    auto trouble = good ? QString() : text(good.error().message());
    for (const auto& [name, box] : numbers_)
        if (!box->good()) trouble = QStringLiteral("%1: %2").arg(name, box->trouble());
    trouble_->setText(trouble);
    trouble_->setVisible(!trouble.isEmpty());
    accept_->setEnabled(trouble.isEmpty());
}

} // namespace atirma::console
